"""The calibration certificate: its content, its Word form and its digital form (DCC)."""
