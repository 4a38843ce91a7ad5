"""What the add-in computes, free of the host: only the standard library is imported here."""
