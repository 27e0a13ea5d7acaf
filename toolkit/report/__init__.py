"""Content to tables, figures, Word and PDF; every renderer lives here."""
