"""The page kit: every HTML page is one file that opens without a network and asks for nothing."""
