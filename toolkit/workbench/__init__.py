"""The workbench: what people look at and decide, served to the browser of this computer alone."""
