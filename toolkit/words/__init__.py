"""The house's words: English in code and templates, other languages in catalogues of phrases (gettext).

The workbench's pages look a phrase up where they print it. A document cannot: its sentences come from
every stage, travel in reduced tests, records and answers, and the language is that of the paper alone. So a
document recognises a sentence by its phrase (`toolkit.words.phrasebook`).
"""
