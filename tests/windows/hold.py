"""Hold a file open in the Windows Python, as another program does: ``hold.py FILE`` until its input ends."""

import sys

if __name__ == "__main__":
    with open(sys.argv[1], "rb"):
        print("holding", flush=True)
        sys.stdin.read()
