"""The language server: what the compiler says, in an editor, of text that is not saved yet."""
