"""What commands have in common: types of arguments, the parser, messages and exit codes, progress."""
