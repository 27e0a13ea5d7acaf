"""The template contract: open, lint, fill and verify an organisation's own Word file."""
