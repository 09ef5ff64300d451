"""The mailbox of mail.test."""
