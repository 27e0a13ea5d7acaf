"""Walls around a worker: no network, no signal out, nothing written but in one temporary folder.

By name spaces (user, mounts, network, IPC, processes: unshare(2)) where the kernel gives them to everybody,
else by Landlock, whose sixth version first keeps signals and abstract sockets in; Landlock's rules for files
stand in both cases where there are any. A filter of system calls (seccomp) refuses every socket: one in the
file system, of a container service for example, would lead out past all of these. The walls are tried before
the code runs. Numbers of calls and flags are those of linux/landlock.h, mount.h, seccomp.h and unistd.h.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import socket
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from toolkit.errors import ConfigError

_NEW = 0x10000000 | 0x00020000 | 0x40000000 | 0x08000000 | 0x20000000  # user, mounts, network, IPC, processes
_RECURSIVE, _PRIVATE, _BIND, _NO_SUID, _NO_DEVICES, _NO_EXEC, _READ_ONLY = (
    1 << 14,
    1 << 18,
    1 << 12,
    2,
    4,
    8,
    1,
)
_MOUNT_SETATTR, _RULESET, _ADD_RULE, _RESTRICT = 442, 444, 445, 446
_HERE, _ALL_MOUNTS = -100, 0x8000  # AT_FDCWD, AT_RECURSIVE
_DEVICES = ("null", "zero", "full", "random", "urandom")
_NO_NEW_PRIVILEGES, _SECCOMP, _DROP_BOUND = 38, 22, 24  # of prctl(2)
_CAPABILITIES = 0x20080522
_SIGNALS_KEPT = 6  # first version of Landlock with scopes
# Landlock: what writes to a file, what changes folders; each with the version that knows it.
_OF_FILES = ((1, 1 << 1), (3, 1 << 14), (5, 1 << 15))
_OF_FOLDERS = ((1, sum(1 << bit for bit in range(4, 13))), (2, 1 << 13))
_BIND_AND_CONNECT, _SCOPES = 3, 3

_ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
# Calls that are refused, by their numbers on x86_64 and aarch64; what only one of them has is -1 there.
_NEVER = {
    "socket": (41, 198), "io_uring_setup": (425, 425), "ptrace": (101, 117), "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271), "pidfd_getfd": (438, 438), "unshare": (272, 97), "setns": (308, 268),
    "mount": (165, 40), "umount2": (166, 39), "pivot_root": (155, 41), "mount_setattr": (442, 442),
    "open_tree": (428, 428), "move_mount": (429, 429), "fsopen": (430, 430), "fsmount": (432, 432),
    "bpf": (321, 280), "perf_event_open": (298, 241), "userfaultfd": (323, 282), "add_key": (248, 217),
    "request_key": (249, 218), "keyctl": (250, 219),
}  # fmt: skip
# What Landlock lets through, and name spaces do not: owners, modes, times, attributes, shared memory, queues.
_WITHOUT_NAMESPACES = {
    "chmod": (90, -1), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452), "chown": (92, -1),
    "fchown": (93, 55), "lchown": (94, -1), "fchownat": (260, 54), "utime": (132, -1), "utimes": (235, -1),
    "futimesat": (261, -1), "utimensat": (280, 88), "setxattr": (188, 5), "lsetxattr": (189, 6),
    "fsetxattr": (190, 7), "removexattr": (197, 14), "lremovexattr": (198, 15), "fremovexattr": (199, 16),
    "setxattrat": (463, 463), "removexattrat": (466, 466), "shmget": (29, 194), "shmat": (30, 196),
    "msgget": (68, 186), "semget": (64, 190), "mq_open": (240, 180), "setpriority": (141, 140),
    "sched_setscheduler": (144, 119), "sched_setattr": (314, 274), "ioprio_set": (251, 30),
}  # fmt: skip
_OF_ITSELF = {"prlimit64": (302, 261), "sched_setaffinity": (203, 122)}  # with another process's id: never


class _Attributes(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in ("set", "clear", "propagation", "namespace")]


class _Rule(ctypes.Structure):
    _pack_ = 1
    _fields_ = [("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32)]


class _Filter(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("code", ctypes.c_char_p)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Walls:
    """Walls around the folder ``scratch``; ``namespaces`` tells whether the process stands in new ones.

    ``inside`` is the id of the process that began them: nobody in them can reach it.
    """

    scratch: str
    namespaces: bool
    inside: int

    @classmethod
    def around(cls, scratch: str, size: int) -> Walls:
        """Enter new name spaces, the file system read-only but for a folder of ``size`` bytes.

        Where the kernel gives none, Landlock alone has to do.

        Raises
        ------
        ConfigError
            ``no-isolation``: the kernel has neither, or the processor's calls are not known here
        """
        if platform.machine() not in _ARCHITECTURES:
            _refuse(f"a processor {platform.machine()}")
        inside, entered = os.getpid(), _can_enter(scratch, size)
        if entered:
            _enter(scratch, size)
        elif landlock_version() < _SIGNALS_KEPT:
            version = landlock_version()
            _refuse(f"no name spaces for this user, and Landlock {version or 'neither'}")
        return cls(scratch=scratch, namespaces=entered, inside=inside)

    def see_own_processes(self) -> None:
        """Mount /proc anew, with the processes of the name space alone, where the container allows that."""
        libc().mount(b"proc", b"/proc", b"proc", _NO_SUID | _NO_DEVICES | _NO_EXEC | _READ_ONLY, None)

    def close(self) -> None:
        """Close the walls around this process and all that will come of it, and try them.

        Raises
        ------
        ConfigError
            ``no-isolation``: a wall could not be closed, or does not hold
        """
        import tempfile

        os.environ["TMPDIR"], tempfile.tempdir = self.scratch, None
        library = libc()
        if self.namespaces:
            for number in range(64):
                library.prctl(_DROP_BOUND, number, 0, 0, 0)
            head, none = struct.pack("<II", _CAPABILITIES, 0), bytes(24)
            _checked(library.capset(head, none), "capset")
        _checked(library.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0), "prctl")
        version = landlock_version()
        if version:
            _landlock(self.scratch, version)
        calls = _NEVER if self.namespaces else _NEVER | _WITHOUT_NAMESPACES
        _filter_calls(calls, {} if self.namespaces else _OF_ITSELF)
        self._try()

    def _try(self) -> None:
        """Refuse to go on where something leads out after all."""
        with contextlib.suppress(OSError):
            socket.socket().close()
            _refuse("a socket could be opened")
        beside = f"{os.path.dirname(self.scratch)}/toolkit-{os.getpid()}-probe"  # noqa: PTH120
        with contextlib.suppress(OSError):
            os.close(os.open(beside, os.O_CREAT | os.O_WRONLY, 0o600))
            os.unlink(beside)  # noqa: PTH108
            _refuse("a file could be written outside of the temporary folder")
        if not self.namespaces:
            with contextlib.suppress(OSError):
                os.kill(self.inside, 0)
                _refuse("a process outside could be signalled")
        elif os.getppid() != 1:
            _refuse("the processes outside could be named")
        with open(f"{self.scratch}/probe", "wb") as stream:  # noqa: PTH123
            stream.write(b"inside")
        os.unlink(f"{self.scratch}/probe")  # noqa: PTH108


def libc() -> ctypes.CDLL:
    """Return the C library, whose calls leave their error number with ctypes."""
    return ctypes.CDLL(None, use_errno=True)


def landlock_version() -> int:
    """Return the version of the kernel's Landlock, 0 where it has none."""
    return max(0, int(libc().syscall(_RULESET, None, 0, 1)))


def _can_enter(scratch: str, size: int) -> bool:
    """Tell whether the kernel gives name spaces: a child tries, as there is no way back."""
    child = os.fork()
    if child == 0:
        try:
            _enter(scratch, size)
            os._exit(0)
        finally:
            os._exit(1)
    return os.waitpid(child, 0)[1] == 0


def _enter(scratch: str, size: int) -> None:
    """Enter new name spaces with a read-only view of the file system."""
    library, user, group = libc(), os.geteuid(), os.getegid()
    _checked(library.unshare(_NEW), "unshare")
    _put("/proc/self/setgroups", "deny")
    _put("/proc/self/uid_map", f"{user} {user} 1")
    _put("/proc/self/gid_map", f"{group} {group} 1")
    _checked(library.mount(b"none", b"/", None, _RECURSIVE | _PRIVATE, None), "mount")
    devices = [f"/dev/{name}" for name in _DEVICES if Path(f"/dev/{name}").is_char_device()]
    for device in devices:
        _checked(library.mount(device.encode(), device.encode(), None, _BIND, None), "mount")
    _set_mount("/", _ALL_MOUNTS, set_=_READ_ONLY | _NO_SUID | _NO_DEVICES)
    for device in devices:
        _set_mount(device, 0, clear=_NO_DEVICES)
    options = f"size={size},mode=700".encode()
    flags = _NO_SUID | _NO_DEVICES
    _checked(library.mount(b"tmpfs", scratch.encode(), b"tmpfs", flags, options), "mount")


def _put(path: str, text: str) -> None:
    with open(path, "w", encoding="ascii") as stream:  # noqa: PTH123
        stream.write(text)


def _set_mount(path: str, flags: int, *, set_: int = 0, clear: int = 0) -> None:
    attributes = _Attributes(set_, clear, 0, 0)
    size = ctypes.sizeof(attributes)
    answer = libc().syscall(
        _MOUNT_SETATTR, _HERE, path.encode(), flags, ctypes.byref(attributes), ctypes.c_size_t(size)
    )
    _checked(answer, "mount_setattr")


def _landlock(scratch: str, version: int) -> None:
    """Forbid this process every writing but in a folder and to the harmless devices."""
    files = sum(bits for since, bits in _OF_FILES if version >= since)
    everything = files | sum(bits for since, bits in _OF_FOLDERS if version >= since)
    handled = [everything]
    handled += [_BIND_AND_CONNECT] if version >= 4 else []
    handled += [_SCOPES] if version >= _SIGNALS_KEPT else []
    attributes = struct.pack(f"<{len(handled)}Q", *handled)
    library = libc()
    rules = library.syscall(_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    _checked(rules, "landlock_create_ruleset")
    for path, allowed in ((scratch, everything), *((f"/dev/{name}", files) for name in _DEVICES)):
        with contextlib.suppress(FileNotFoundError):
            place = os.open(path, os.O_PATH | os.O_CLOEXEC)
            rule = _Rule(allowed, place)
            _checked(library.syscall(_ADD_RULE, rules, 1, ctypes.byref(rule), 0), "landlock_add_rule")
            os.close(place)
    _checked(library.syscall(_RESTRICT, rules, 0), "landlock_restrict_self")
    os.close(rules)


def _filter_calls(never: dict[str, tuple[int, int]], of_itself: dict[str, tuple[int, int]]) -> None:
    """Refuse system calls with EPERM, for this process and all that will come of it.

    The program of seccomp(2), an instruction a line: code, jump if true, jump if false, operand.
    """
    at = list(_ARCHITECTURES).index(platform.machine())
    load, equal, at_least, give = 0x20, 0x15, 0x35, 0x06
    refuse, allow, kill = (give, 0, 0, 0x00050000 | 1), (give, 0, 0, 0x7FFF0000), (give, 0, 0, 0x80000000)
    program = [
        (load, 0, 0, 4),  # the architecture: another one has other numbers
        (equal, 1, 0, _ARCHITECTURES[platform.machine()]),
        kill,
        (load, 0, 0, 0),  # the call's number
        (at_least, 0, 1, 0x40000000),  # calls of x32
        refuse,
    ]
    for numbers in never.values():
        if numbers[at] >= 0:
            program += [(equal, 0, 1, numbers[at]), refuse]
    for numbers in of_itself.values():
        program += [(equal, 0, 3, numbers[at]), (load, 0, 0, 16), (equal, 1, 0, 0), refuse, (load, 0, 0, 0)]
    program.append(allow)
    code = b"".join(struct.pack("<HBBI", *line) for line in program)
    library = libc()
    _checked(library.prctl(_SECCOMP, 2, ctypes.byref(_Filter(len(program), code)), 0, 0), "seccomp")


def _checked(answer: int, call: str) -> None:
    if answer < 0:
        _refuse(f"{call}: {os.strerror(ctypes.get_errno())}")


def _refuse(actual: str) -> NoReturn:
    raise ConfigError(
        "the case's code cannot be isolated here", where="--isolated", got=actual,
        expected="a Linux kernel whose users may make name spaces, or with Landlock 6 (Linux 6.12)",
        next_step="allow name spaces to users (user.max_user_namespaces, the container's seccomp profile), "
        "or run the case without --isolated where you trust its code",
        rule="no-isolation",
    )  # fmt: skip
