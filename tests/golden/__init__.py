"""Golden files: what the code answered when they were frozen, and a reader that asks the code of today.

``python -m tests.golden check`` runs every entry through the command line, in this process, and prints each
value that is not the frozen one: its key path, the frozen value and today's. ``freeze`` writes the files.

Rules
-----
- Numbers are frozen with every digit and compared bit by bit. Answers of a diagnosis are compared to 1e-9 of
  a standard error, since the order of a search may change and its minimum not (`tests.golden.compare`).
- Texts that are sentences for people (a finding's message, a statement) may be worded anew: the numbers in
  them must stay, and the check lists such sentences apart.
- Times, software versions, ledger heads and folders are no results and are left out
  (`tests.golden.workplace`).
- On another processor or with other libraries the last bits of linear algebra differ, and with them hashes
  and the ends of searches. The files hold a fingerprint of the arithmetic that made them; where it is
  another, nothing is compared, and the check tells how to freeze the same commit there.
- What the command line cannot give is imported in `tests.golden.surface` and nowhere else.
"""
