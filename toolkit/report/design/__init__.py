"""The templates that come with the toolkit, built by code and kept byte for byte."""
