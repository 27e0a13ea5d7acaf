"""Records on disk: the ledger, the gates, what is in force, who decided."""
