"""What people read: self-contained HTML pages, tables, and text between markers of a file."""
