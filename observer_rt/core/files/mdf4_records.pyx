"""Records of an unsorted MDF 4 data group: kind and place of each."""

from libc.stdint cimport int64_t, uint64_t

from numpy import empty

cdef enum:
    LENGTH_SIZE = 4  # bytes of a length before a record of variable length
    VARIABLE = -1  # length of a record that tells its own
    UNKNOWN_ID = -1

globals().update(LENGTH_SIZE=LENGTH_SIZE, VARIABLE=VARIABLE, UNKNOWN_ID=UNKNOWN_ID)


cdef uint64_t _number(const unsigned char[::1] data, int64_t place, int64_t size) noexcept nogil:
    """Little-endian."""
    cdef uint64_t number = 0
    cdef int64_t byte
    for byte in range(size):
        number |= <uint64_t> data[place + byte] << <uint64_t> (8 * byte)
    return number


def walk(
    const unsigned char[::1] data,
    int64_t position,
    int64_t id_size,
    const uint64_t[::1] ids,
    const int64_t[::1] lengths,
    int64_t[::1] kind_of,
    int64_t[::1] place_of,
) -> tuple[int, int, int]:
    """Note kind and place of records from a position on; how many, the position after them, and why it ends there.

    That is the bytes the next one needs, 0 where there is no room to note it, or UNKNOWN_ID. ids: rising; lengths of
    their records, VARIABLE: it stands before each; id_size: bytes of an id, at most 8.
    """
    cdef int64_t count, begin, kind, length
    cdef uint64_t wanted
    if lengths.shape[0] != ids.shape[0] or place_of.shape[0] != kind_of.shape[0] or not 0 <= id_size <= 8:
        raise ValueError("a length of every id, and a kind and a place of every record are wanted")
    for count in range(kind_of.shape[0]):
        begin = position + id_size
        if begin > data.shape[0]:
            return count, position, id_size
        wanted, kind = _number(data, position, id_size), 0
        while kind < ids.shape[0] and ids[kind] < wanted:
            kind += 1
        if kind == ids.shape[0] or ids[kind] != wanted:
            return count, position, UNKNOWN_ID
        length = lengths[kind]
        if length == VARIABLE:
            if begin + LENGTH_SIZE > data.shape[0]:
                return count, position, id_size + LENGTH_SIZE
            length = LENGTH_SIZE + <int64_t> _number(data, begin, LENGTH_SIZE)
        if begin + length > data.shape[0]:
            return count, position, id_size + length
        kind_of[count], place_of[count] = kind, begin
        position = begin + length
    return kind_of.shape[0], position, 0


def numbers_at(const unsigned char[::1] data, const int64_t[::1] places, int64_t size) -> object:
    """Little-endian numbers of so many bytes, at most 8, at some places; both (n,)."""
    cdef int64_t i
    numbers = empty(places.shape[0], "u8")
    cdef uint64_t[::1] result = numbers
    if not 0 <= size <= 8:
        raise ValueError("a number has at most 8 bytes")
    for i in range(places.shape[0]):
        if not 0 <= places[i] <= data.shape[0] - size:
            raise ValueError("a number outside of the data")
    with nogil:
        for i in range(places.shape[0]):
            result[i] = _number(data, places[i], size)
    return numbers
