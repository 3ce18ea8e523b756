"""`python -m rodcone`: the command, where its script is not on the path."""

from importlib import import_module

if __name__ == "__main__":
    import_module("studies.commands.cli").main()  # by name, because imports run downwards only
