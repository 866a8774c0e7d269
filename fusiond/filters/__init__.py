"""One recursion per file, pure: predict and update, with their source."""
