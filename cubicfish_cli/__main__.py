"""``python -m cubicfish_cli`` is ``cubicfish``."""

from cubicfish_cli.terminal.start import main

if __name__ == "__main__":
    main()
