"""Letters and other texts, in LibreOffice Writer."""
