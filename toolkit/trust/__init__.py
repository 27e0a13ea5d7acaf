"""Who decided, and whether today's ledger continues what was issued: people, signatures, log, witnesses."""
