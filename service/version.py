"""The version of the product, as programs, reports and the API carry it."""

VERSION = "0.1.0"
