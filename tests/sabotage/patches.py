"""The patches: short texts that are hard to miss, so that they stay where the code is moved."""

from __future__ import annotations

from tests.sabotage.scratch import Patch

_SHARE = "test_battery.py -k quick_share and {}"
_EDITED, _DAMAGED, _CRAFTED, _BOMBS, _MAPS, _DRIVES, _WRITES, _CACHE, _NAMES = (
    _SHARE.format(words)
    for words in (
        "edited",
        "damaged",
        "crafted",
        "bombs",
        "maps",
        "scans",
        "failing",
        "cache",
        "hostile",
    )
)

_LOGS = [
    Patch(
        "a summary that fails its checksum is not used",
        "io/logs/mcap_file.py",
        "if declared not in {0, zlib.crc32(footer[:25], crc)}",
        "if declared not in {declared, zlib.crc32(footer[:25], crc)}",
        _EDITED,
    ),
    Patch(
        "the file's own count is compared",
        "io/logs/report.py",
        "        if not self.hurt and declared != found:",
        "        if declared:\n            return\n        if not self.hurt and declared != found:",
        _EDITED,
    ),
    Patch(
        "later chunks are read where framing broke",
        "io/logs/mcap_file.py",
        "if self.resumes >= RESUMES or not self.search():",
        "if self.resumes >= 0 or not self.search():",
        "io/test_logs_mcap.py -k resumes",
    ),
    Patch(
        "what a damaged record has swallowed is searched, whatever stands behind it",
        "io/logs/mcap_file.py",
        "if self.safe_at < at:",
        "if self.safe_at < at and rec.RECORD.unpack(head)[0] not in rec.KNOWN:",
        "io/test_logs_losses.py -k swallowed",
    ),
    Patch(
        "an end in the middle of a file does not end it",
        "io/logs/mcap_file.py",
        "and not another and not whole:",
        "and not another and whole is None:",
        "io/test_logs_losses.py -k footer or moved_end",
    ),
    Patch(
        "checksums of chunks are verified",
        "io/logs/mcap_file.py",
        "if head.crc and zlib.crc32(plain) != head.crc:",
        "if head.crc < 0:",
        "io/test_logs_mcap.py -k fails_its_checksum",
    ),
    Patch(
        "the checksum of the data section is verified",
        "io/logs/mcap_file.py",
        "if declared not in {0, crc} and self.src.crc_valid",
        "if declared not in {declared, crc} and self.src.crc_valid",
        "io/test_logs_mcap.py -k data_checksum",
    ),
    Patch(
        "--strict ends at the first damage",
        "io/logs/log.py",
        "if self.strict:",
        "if self.strict and damage.lossless:",
        "test_promises.py -k strict",
    ),
    Patch(
        "damage is told with exit code 3",
        "io/logs/base.py",
        "return self.undecodable > 0 or any(not damage.lossless for damage in self.damages)",
        "return self.undecodable > 0",
        _DAMAGED,
    ),
    Patch(
        "no chunk is inflated beyond 256 MiB",
        "io/logs/inflate.py",
        "    if size > CHUNK_LIMIT:",
        "    if size < 0:",
        "io/test_logs_reorder.py -k bombs",
    ),
    Patch(
        "a chunk gives exactly what it declares",
        "io/logs/inflate.py",
        "    if len(plain) != size:",
        "    if size < 0:",
        "io/test_logs_reorder.py -k bombs",
    ),
    Patch(
        "only plain tables of a database are read",
        "io/logs/db3_file.py",
        """        if found is None or "VIRTUAL" in str(found[0])[:20].upper():
            return False""",
        """        if found is None:
            return True""",
        "io/test_logs_db3.py -k views",
    ),
    Patch(
        "a database is read with its write-ahead log",
        "io/logs/db3_file.py",
        """for suffix in ("-wal", "-journal")""",
        """for suffix in ("-journal",)""",
        "io/test_logs_db3.py -k write_ahead",
    ),
    Patch(
        "the definition that a log has of a type is compared",
        "io/messages/definitions.py",
        "    if known != recorded[short_name(kind)]:",
        "    if not known:",
        "io/test_messages_damaged.py -k agree",
    ),
    Patch(
        "a message has exactly the length of its type",
        "io/messages/parsing.py",
        "return value if 0 <= len(data) - 4 - end <= 3 else Undecodable(_LENGTH)",
        "return value",
        "io/test_messages_damaged.py",
    ),
    Patch(
        "rotations that are none are not used",
        "io/messages/decoding.py",
        "return abs(math.hypot(*quaternion) - 1.0) <= 1e-2 and",
        "return",
        "io/test_messages.py",
    ),
]

_MAPS_AND_TEXTS = [
    Patch(
        "a raster has as many pixels as its header says, and none pushed out behind them",
        "io/maps/netpbm.py",
        "    if not after_pixels.is_no_pixels(rest):",
        "    if not after_pixels:",
        "io/test_image.py",
    ),
    Patch(
        "a PNG has all its rows",
        "io/maps/png_check.py",
        "    if found != expected:",
        "    if found > expected:",
        "test_battery.py -k found and rows",
    ),
    Patch(
        "checksums of a PNG are verified",
        "io/maps/png_check.py",
        'if data[end : end + 4] != struct.pack(">I", zlib.crc32(view[position + 4 : end])):',
        "if not data:",
        "io/test_image.py",
    ),
    Patch(
        "a picture that is too large is refused by its header",
        "io/maps/image.py",
        "    if width * height > max_cells:",
        "    if width < 0:",
        "io/test_image.py -k max_cells or believed",
    ),
    Patch(
        "the image of a map stays in its folder",
        "io/maps/map_yaml.py",
        "if exists and (inside or allow_outside):",
        "if exists:",
        "io/test_map_yaml.py -k outside",
    ),
    Patch(
        "free wins ties, as in map_server",
        "io/maps/map_yaml.py",
        "    cells[p <= low] = FREE",
        "    cells[p < low] = FREE",
        "io/test_map_yaml.py",
    ),
    Patch(
        "YAML has no aliases",
        "io/tables/safe_yaml.py",
        'if kind == "Alias" or event.anchor is not None:',
        "if event is None:",
        "io/test_safe_yaml.py",
    ),
    Patch(
        "a key stands once in YAML",
        "io/tables/safe_yaml.py",
        "if key in pairs and not self.limits.repeats:",
        "if key is None:",
        "io/test_safe_yaml.py",
    ),
    Patch(
        "quantities are finite",
        "quantity.py",
        "    if not math.isfinite(value):",
        "    if value is None:",
        "test_quantity.py",
    ),
    Patch(
        "time that jumps back begins a new segment",
        "replay/intake.py",
        "stamp_ns < self.path.last_ns - _JUMP_NS",
        "stamp_ns < -self.path.last_ns - _JUMP_NS",
        "test_promises.py -k jumps_back",
    ),
    Patch(
        "a stamp of 0 is the log's time",
        "io/messages/conversion.py",
        "        if stamp_ns == 0:",
        "        if stamp_ns < 0:",
        "io/test_messages.py",
    ),
]

_OUTPUTS = [
    Patch(
        "outputs grow under another name",
        "io/traces/output.py",
        'final.with_name(f"{_shortened(final.name)}.{secrets.token_hex(4)}.part")',
        'Path(f"{final}{secrets.token_hex(4)[:0]}"); final.unlink(missing_ok=True)',
        _WRITES,
    ),
    Patch(
        "outputs are on the disk before they have their name",
        "io/traces/output.py",
        "os.fsync(self._opened().fileno())",
        "self._opened().flush()",
        _WRITES,
    ),
    Patch(
        "an output that fails leaves nothing behind",
        "io/traces/output.py",
        "                self._temporary.unlink()",
        "                pass",
        _WRITES,
    ),
    Patch(
        "nothing is on stdout of a run that is refused",
        "cli/run/outputs.py",
        "            if kind is None:\n                self._begin()",
        "            self._begin()",
        "cli/test_run.py -k refused",
    ),
    Patch(
        "an output is never an input",
        "io/traces/output.py",
        "if status is not None and os.path.samestat(found, status):",
        "if status is None:",
        "io/test_output.py",
    ),
    Patch(
        "no number that is none is written",
        "io/traces/sinks.py",
        '        raise ValueError(f"{what} to be written is not finite")',
        "        return",
        "io/test_trace_csv.py",
    ),
    Patch(
        "CSV fields are no formulas",
        "io/traces/sinks.py",
        'if text.startswith(("=", "+", "-", "@", "\\t", "\\r")) and not _is_number(text):',
        "if text is None:",
        _NAMES,
    ),
    Patch(
        "text from files is made safe to show",
        "text.py",
        "    shown = _UNSAFE.sub(_escape, text)",
        "    shown = text",
        _NAMES,
    ),
    Patch(
        "SIGTERM finishes what is written",
        "startup.py",
        '(("SIGINT", interrupt), ("SIGTERM", terminate), ("SIGHUP", terminate))',
        '(("SIGINT", interrupt), ("SIGHUP", terminate))',
        "cli/test_process.py -k interrupted",
    ),
    Patch(
        "SIGHUP finishes what is written",
        "startup.py",
        ', ("SIGHUP", terminate)',
        "",
        "cli/test_process.py -k interrupted",
    ),
    Patch(
        "a signal that the parent ignores is ignored",
        "startup.py",
        " and signal.getsignal(number) != signal.SIG_IGN:",
        ":",
        "cli/test_signals.py -k parent_ignores",
    ),
    Patch(
        "what an interrupted run wrote replaces no file",
        "io/traces/output.py",
        "os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600",
        "os.O_WRONLY | os.O_CREAT, 0o600",
        "io/test_output.py -k part_never",
    ),
    Patch(
        "no file gets the descriptor of a closed stream",
        "startup.py",
        "            _occupy()",
        "            continue",
        "cli/test_streams.py -k descriptors",
    ),
    Patch(
        "a full standard error ends no command",
        "startup.py",
        "        except OSError:\n            self._give_up()\n            return len(text)",
        "        except OSError:\n            raise",
        "cli/test_streams.py -k its_streams and file",
    ),
    Patch(
        "a closed pipe ends with 141",
        "cli/process.py",
        "return 128 + signal.SIGPIPE",
        "return 1",
        "cli/test_process.py -k closed_pipe",
    ),
    Patch(
        "an interrupted MCAP is kept",
        "io/traces/output.py",
        "        self._keep_part = True",
        "        self._keep_part = False",
        "io/test_output.py -k part",
    ),
]

_CACHES = [
    Patch(
        "what other users put there is not used",
        "ownership.py",
        'return sys.platform == "win32" or status.st_uid == os.getuid()',
        "return bool(status)",
        "test_cache.py -k another_user",
    ),
    Patch(
        "what others may write to is not used",
        "ownership.py",
        "if status.st_mode & stat.S_IWOTH:",
        "if status.st_mode < 0:",
        "test_cache.py -k others_may_write",
    ),
    Patch(
        "what a group may write to is not used",
        "ownership.py",
        "return members <= known | {name}",
        "return members <= members | {name}",
        "test_cache.py -k group",
    ),
    Patch(
        "links are not followed out of the cache",
        "cache.py",
        'why = "it is a link" if stat.S_ISLNK(status.st_mode) else',
        'why = "" if stat.S_ISLNK(status.st_mode) else',
        "test_cache.py -k link_within",
    ),
    Patch(
        "the processor stands in the file of machine code",
        "native/machine_code.py",
        'if header["processor"] != _processor():',
        'if not header["processor"]:',
        "test_cache.py -k another_processor",
    ),
    Patch(
        "a field is on the disk before it has its name",
        "cache.py",
        "            os.fsync(file.fileno())",
        "            file.flush()",
        _WRITES,
    ),
    Patch(
        "the processor is in the key of machine code",
        "native/backend.py",
        'return _digest_for(f"{llvm.get_host_cpu_name()} {_processor_features()}")',
        'return _digest_for(f"{llvm.__name__}")',
        _CACHE,
    ),
    Patch(
        "altered machine code is not run",
        "native/machine_code.py",
        'if header["sha256"] != _digest(header["functions"], payload):',
        'if not header["sha256"]:',
        _CACHE,
    ),
    Patch(
        "an altered field is not used",
        "io/maps/field_cache.py",
        "if header != _header(grid, kind, max_dist, codes, levels, digest.hexdigest()):",
        'if header != _header(grid, kind, max_dist, codes, levels, header["sha256"]):',
        "io/test_field_cache.py",
    ),
    Patch(
        "an altered pyramid is not used",
        "io/maps/pyramid_cache.py",
        "or start != _header(digest, hashed.hexdigest()):",
        'or not start.startswith(_header(digest, "")[:60]):',
        _CACHE,
    ),
]

PATCHES = (*_LOGS, *_MAPS_AND_TEXTS, *_OUTPUTS, *_CACHES)
