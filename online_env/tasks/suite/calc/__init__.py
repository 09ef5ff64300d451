"""Workbooks, in LibreOffice Calc."""
