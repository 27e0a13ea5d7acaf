"""Inputs that failed, each as the bench printed it: the format and its mutations."""

RECIPES = (
    # An index beyond the fields of a tag, where a channel's name stands in the first column.
    ("run.lvm", '[["line_swap", 3, 11], ["line_double", 9, 500]]'),
    ("german.lvm", '[["word", 3, 0, "1e999"]]'),
    # Flags that skipped the check of a group's length: the reader waited for data that never came.
    ("run.mf4", f'[["insert", 995, "{"9" * 400}"]]'),
    # A sign for a load that no session can have.
    ("machine", '[["misspell", ["cell", 1, "polarity", "MX"]]]'),
    # A message that did not say what stood there.
    ("tir-evaluated", '[["cut", 417], ["cut", 502]]'),
    # A name that is longer than any file's.
    ("continuous-plan", '[["set", ["machine"], "long"]]'),
    # A relation without a name, among others that were sorted by theirs.
    ("template", '[["part", "word/_rels/document.xml.rels", ["replace", "Id=\\"rId1\\"", ""]]]'),
    # A misspelt key of a quantity.
    ("session", '[["add", ["polarity", 0, "indications", "D52"], "minus"]]'),
    # A number that overflows in SI: a solver waited for ever on what came of it.
    ("test", '[["set", ["tare", "values", "E5"], "far"]]'),
    # The same in a recording.
    ("run.csv", '[["word", 3, 0, "1.7e308"]]'),
    # A state of a watch with a list where a text stands.
    ("watch-state", '[["set", ["tests", "a", "rule"], "numbers"]]'),
    # Styles whose kind no declaration states: a library hands them over as plain bytes.
    (
        "template",
        '[["part", "[Content_Types].xml", '
        '["replace", "PartName=\\"/word/styles.xml\\"", "PartName=\\"99999999999\\""]]]',
    ),
    (
        "template",
        '[["part", "[Content_Types].xml", ["replace", "ContentType=\\"application/'
        'vnd.openxmlformats-officedocument.wordprocessingml.styles+xml\\"", ""]]]',
    ),
)
