"""The frame in which libcluon sends and records a message: ``0D A4``, the length in 3 bytes, an Envelope.

All times are microseconds since the epoch; on the wire they are seconds and microseconds, both truncated
toward zero, so both are negative before 1970.
"""

from typing import Any, NamedTuple

from google.protobuf.message import DecodeError

from dodo_dsl.opendlv import odvd, wire
from dodo_dsl.opendlv.address import HEADER_BYTES, MAGIC, FrameError, body_length
from dodo_dsl.opendlv.protobuf_classes import build

MAX_BODY_BYTES = 2**24 - 1
MICROSECONDS = 1_000_000


class Envelope(NamedTuple):
    """A message on its way: ``data_type`` is its id, ``payload`` its encoding.

    ``sent``, ``received`` and ``sample_time`` are microseconds since the epoch; ``sender_stamp`` distinguishes senders
    of the same message apart.
    """

    data_type: int
    payload: bytes
    sent: int
    received: int
    sample_time: int
    sender_stamp: int


LAYOUT = build(
    odvd.parse(
        """
        message cluon.data.TimeStamp [id = 12] { int32 seconds; int32 microseconds; }
        message cluon.data.Envelope [id = 1] {
          int32 dataType; bytes serializedData;
          cluon.data.TimeStamp sent; cluon.data.TimeStamp received; cluon.data.TimeStamp sampleTimeStamp;
          uint32 senderStamp;
        }"""
    )
)["cluon.data.Envelope"]
_TYPE: Any = LAYOUT.type


def encode_frame(envelope: Envelope) -> bytes:
    """The frame of an envelope; raises FrameError if a number or the payload is too large."""
    data_type, payload, sent, received, sample_time, sender_stamp = envelope
    proto = _TYPE()
    try:
        proto.dataType, proto.serializedData, proto.senderStamp = data_type, payload, sender_stamp
        for stamp, time in (proto.sent, sent), (proto.received, received), (proto.sampleTimeStamp, sample_time):
            seconds, microseconds = divmod(abs(time), MICROSECONDS)
            stamp.seconds, stamp.microseconds = (seconds, microseconds) if time >= 0 else (-seconds, -microseconds)
    except ValueError as error:
        raise FrameError(f"the envelope cannot be encoded: {error}") from None
    body: bytes = proto.SerializeToString()
    if len(body) > MAX_BODY_BYTES:
        raise FrameError(f"an envelope of {len(body)} bytes is larger than a frame, {MAX_BODY_BYTES} bytes")
    return MAGIC + len(body).to_bytes(3, "little") + body


def decode_frame(frame: bytes, received: int | None = None) -> Envelope:
    """The envelope of a frame, ``received`` at its own time or the one given. Raises FrameError.

    Bytes after the frame are ignored, as libcluon does. Fields come in any order, the first of equal ones counts,
    absent ones are zero.
    """
    end = HEADER_BYTES + body_length(frame)
    if len(frame) < end:
        raise FrameError(f"the frame has {len(frame)} bytes of {end}")
    data_type, payload, (s, us, r_s, r_us, t_s, t_us), stamp = decode_parts(frame[HEADER_BYTES:end])
    if received is None:
        received = r_s * MICROSECONDS + r_us
    return Envelope(data_type, payload, s * MICROSECONDS + us, received, t_s * MICROSECONDS + t_us, stamp)


def decode_parts(body: bytes) -> tuple[int, bytes, list[int], int]:
    """The fields of an encoded envelope: id, payload, six numbers, sender stamp; raises FrameError.

    The numbers are seconds and microseconds of sent, received and sample time.
    """
    try:
        proto = _TYPE.FromString(body)
        if proto.ByteSize() != len(body):
            proto = _TYPE.FromString(wire.keep_first(body, LAYOUT.shape))
    except (DecodeError, wire.WireError) as error:
        raise FrameError(f"the frame holds no envelope: {error}") from None
    sent, received, sampled = proto.sent, proto.received, proto.sampleTimeStamp
    times = [sent.seconds, sent.microseconds, received.seconds, received.microseconds]
    return proto.dataType, proto.serializedData, [*times, sampled.seconds, sampled.microseconds], proto.senderStamp
