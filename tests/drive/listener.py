"""A program beside the application that says what messages come to its bus, and to its own address.

python listener.py --cid=111
"""

import sys

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session

FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])


def main() -> None:
    messages, heard = MessageSet.standard(), set[str]()
    with Session(int(FLAGS["cid"]), messages) as session:
        session.hear_directly()
        while True:
            envelope = session.receive(None)
            if envelope is None:
                continue
            name = f"{messages.name(envelope.data_type) or envelope.data_type}/{envelope.sender_stamp}"
            if name not in heard:
                heard.add(name)
                print(f"heard {name}", flush=True)


if __name__ == "__main__":
    main()
