"""Signatures: people and their signatures, the ledger in a document, seals, and what is verified offline."""
