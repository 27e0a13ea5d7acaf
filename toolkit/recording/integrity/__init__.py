"""Binary formats, walked before their readers: every length and link is a claim until it is checked.

A reader that believes a length allocates what a file asks for, and one that follows links may follow them for
ever. Each module here follows one format's skeleton, within bounds, and refuses what contradicts itself.
"""
