"""An audit for people: its page, its pictures, and the vocabulary and template of its summary."""
