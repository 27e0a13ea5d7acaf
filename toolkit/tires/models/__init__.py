"""The tire models, one a file; each module has one ``MODEL``. `toolkit.tires.catalog` finds them."""
