//! Logs of frames as people have them, typed by what their documents say; each has the same four frames.

use super::super::{frame_diff::frame_diff, read_with};
use super::tests::settings;
use super::{ImportedCapture, ReadSettings};
use harness_proto::time::Span;

/// Two reads of register 30 (ex 9), the first one at some time, the others 0.4, 100 and 100.4 ms later.
const FRAMES: [&str; 4] = ["201#3D3000", "181#30CD0C00", "201#3D3000", "181#30CC0C00"];

const BUSMASTER: &str = "***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n***HEX***\n***SYSTEM MODE***\n\
                         ***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***\n";

const ASC: &str =
    "date Wed Jun 3 10:00:00.000 am 2026\nbase hex  timestamps absolute\ninternal events logged\n";

/// Each with a name, its text, and how exact its times are, in microseconds; `None` for one without times.
fn logs() -> Vec<(&'static str, String, Option<u64>)> {
    let log = |name, text: &str, exact| (name, text.to_owned(), exact);
    let screen = |times: [&str; 4]| {
        let rest = [
            "201   [3]  3D 30 00",
            "181   [4]  30 CD 0C 00",
            "201   [3]  3D 30 00",
            "181   [4]  30 CC 0C 00",
        ];
        let lines = times
            .iter()
            .zip(rest)
            .map(|(time, rest)| format!(" {time}  can0  {rest}\n"));
        lines.collect::<String>()
    };
    vec![
        log(
            "headings, comments and tabs",
            "*** Team 9\r\n*** Lap\r\n\r\n# warm\n\r(1718000000.000100)\tcan0\t201#3D3000\n(1718000000.000500) can0 181#30CD0C00\n# cold\n\
             (1718000000.100100) can0 201#3D3000 T\n(1718000000.100500) can0 181#30CC0C00 R\n^C\npi@box7:~$ \n",
            Some(1),
        ),
        ("screen", screen([""; 4]), None),
        (
            "screen -ta",
            screen([
                "(1718000000.000100)",
                "(1718000000.000500)",
                "(1718000000.100100)",
                "(1718000000.100500)",
            ]),
            Some(1),
        ),
        (
            "screen -tA",
            screen([
                "(2026-06-03 08:00:00.000100)",
                "(2026-06-03 08:00:00.000500)",
                "(2026-06-03 08:00:00.100100)",
                "(2026-06-03 08:00:00.100500)",
            ]),
            Some(1),
        ),
        // So short, both look alike.
        (
            "screen -tz",
            screen([
                "(000.000000)",
                "(000.000400)",
                "(000.100000)",
                "(000.100400)",
            ]),
            None,
        ),
        (
            "screen -td",
            screen([
                "(000.000000)",
                "(000.000400)",
                "(000.099600)",
                "(000.000400)",
            ]),
            None,
        ),
        log(
            "screen -x -a -c -i",
            "\x1b[31m  can0  TX - -  201\x1b[0m   [3]  3D 30 00                  '=0.'\n  can0  RX - -  181   [4]  30 CD 0C 00\n\
             \u{20} can0  201   [3]  00111101 00110000 00000000\n  can0  181   [4]  30 CC 0C 00\n^C\n",
            None,
        ),
        log(
            "frames alone",
            "can0 201#3D3000\ncan0 181#30CD0C00\ncan0 201#3D3000\ncan0 181#30CC0C00\n",
            None,
        ),
        log(
            "TRC 1.0",
            ";####\n;   C:\\a.trc\n;    PCAN-Net: X\n;----+- ---+--- ----+--- +- -+ --\n     1)      0  0201 3  3D 30 00\n     2)      0  FFFFFFFF 4 00 00 00 04 -- -- -- -- BUSLIGHT\n\
             \u{20}    3)      0  0181 4  30 CD 0C 00\n     4)    100  0201 3  3D 30 00\n     5)    100  0181 4  30 CC 0C 00\n",
            Some(1_000),
        ),
        log(
            "TRC 1.1",
            ";$FILEVERSION=1.1\n;$STARTTIME=46176.4\n     1)         2.0  Tx     0201  3  3D 30 00\n     2)         2.4  Rx     0181  4  30 CD 0C 00\n\
             \u{20}    3)         9.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY\n     4)       102.0  Tx     0201  3  3D 30 00\n     5)       102.4  Rx     0181  4  30 CC 0C 00\n",
            Some(100),
        ),
        log(
            "TRC 1.2",
            ";$FILEVERSION=1.2\n;$STARTTIME=46176.4\n     1)         2.000 1  Tx     0201  3  3D 30 00\n     2)         2.400 1  Rx     0181  4  30 CD 0C 00\n\
             \u{20}    3)       102.000 1  Tx     0201  3  3D 30 00\n     4)       102.400 1  Rx     0181  4  30 CC 0C 00\n",
            Some(1),
        ),
        log(
            "TRC 1.3",
            ";$FILEVERSION=1.3\n;$STARTTIME=46176.4\n     1)         2.000 1  Tx     0201 -  3    3D 30 00\n     2)         2.400 1  Rx     0181 -  4    30 CD 0C 00\n\
             \u{20}    3)       102.000 1  Tx     0201 -  3    3D 30 00\n     4)       102.400 1  Rx     0181 -  4    30 CC 0C 00\n",
            Some(1),
        ),
        log(
            "TRC 2.0",
            ";$FILEVERSION=2.0\n;$STARTTIME=46176.4\n;$COLUMNS=N,O,T,I,d,l,D\n      1         2.000 DT     0201 Tx 3  3D 30 00\n      2         2.400 DT     0181 Rx 4  30 CD 0C 00\n\
             \u{20}     3         3.000 ST          Rx    00 00 00 08\n      4       102.000 DT     0201 Tx 3  3D 30 00\n      5       102.400 DT     0181 Rx 4  30 CC 0C 00\n",
            Some(1),
        ),
        log(
            "TRC 2.1",
            ";$FILEVERSION=2.1\n;$STARTTIME=46176.4\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n      1         2.000 DT 1      0201 Tx -  3    3D 30 00\n      2         2.400 DT 1      0181 Rx -  4    30 CD 0C 00\n\
             \u{20}     3       102.000 DT 1      0201 Tx -  3    3D 30 00\n      4       102.400 DT 1      0181 Rx -  4    30 CC 0C 00\n",
            Some(1),
        ),
        log(
            "GVRET",
            "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n5000,00000201,false,Tx,0,3,3D,30,00,\n5400,00000181,false,Rx,0,4,30,CD,0C,00,\n\
             105000,00000201,false,Tx,0,3,3D,30,00,\n105400,00000181,false,Rx,0,4,30,CC,0C,00,\n",
            Some(1),
        ),
        log(
            "GVRET without a direction",
            "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n5000,201,false,0,3,3D,30,00\n5400,181,false,0,4,30,CD,0C,00\n\
             105000,201,false,0,3,3D,30,00\n105400,181,false,0,4,30,CC,0C,00\n",
            Some(1),
        ),
        (
            "BUSMASTER over midnight",
            format!(
                "{BUSMASTER}23:59:59:9500 Tx 1 0x201 s 3 3D 30 00 \n23:59:59:9504 Rx 1 0x181 s 4 30 CD 0C 00 \n00:00:00:0500 Tx 1 0x201 s 3 3D 30 00 \n\
                 00:00:00:0504 Rx 1 0x181 s 4 30 CC 0C 00 \n***[STOP LOGGING SESSION]***\n"
            ),
            Some(100),
        ),
        (
            "BUSMASTER, decimal and relative",
            format!(
                "{}00:00:00:0000 Tx 1 513 s 3 61 48 0 \n00:00:00:0004 Rx 1 385 s 4 48 205 12 0 \n00:00:00:0996 Tx 1 513 s 3 61 48 0 \n00:00:00:0004 Rx 1 385 s 4 48 204 12 0 \n",
                BUSMASTER
                    .replace("HEX", "DEC")
                    .replace("SYSTEM", "RELATIVE")
            ),
            Some(100),
        ),
        log(
            "CRTD",
            "1718000000.000 CXX a log\n1718000000.000100 1T11 201 3D 30 00\n1718000000.000500 1R11 181 30 CD 0C 00\n1718000000.050000 1CEV a lap\n\
             1718000000.100100 1T11 201 3D 30 00\n1718000000.100500 1R11 181 30 CC 0C 00\n",
            Some(1),
        ),
        log(
            "python-can's text",
            "Timestamp: 1718000000.000100    ID:      201    S Tx                DL:  3    3d 30 00                    Channel: can0\n\
             Timestamp: 1718000000.000500    ID:      181    S Rx                DL:  4    30 cd 0c 00                 Channel: can0\n\
             Timestamp: 1718000000.100100    ID:      201    S Tx                DL:  3    3d 30 00                    Channel: can0\n\
             Timestamp: 1718000000.100500    ID:      181    S Rx                DL:  4    30 cc 0c 00                 Channel: can0\n",
            Some(1),
        ),
        log(
            "Kvaser",
            "Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir\n 0    00000201         3  3D  30  00                           1.000000 T\n \
             0    00000181         4  30  CD  0C  00                       1.000400 R\n 0    00000201         3  3D  30  00                           1.100000 T\n \
             0    00000181         4  30  CC  0C  00                       1.100400 R\n",
            Some(1),
        ),
        log(
            "CANHacker over a minute",
            "Time   ID     DLC Data                    Comment\n59,950000 201 3 3D 30 00 \n59,950400 181 4 30 CD 0C 00 \n00,050000 201 3 3D 30 00 \n00,050400 181 4 30 CC 0C 00 \n",
            Some(1),
        ),
        (
            "ASC with names",
            format!(
                "{ASC}   0.001000 1  DriveRx         Tx   d 3 3D 30 00  Length = 230000 BitCount = 115 ID = 513\n   0.001400 1  ABBA         Rx   d 4 30 CD 0C 00  Length = 230000 BitCount = 115 ID = 385\n   \
                 0.101000 1  DriveRx         Tx   d 3 3D 30 00  Length = 230000 BitCount = 115 ID = 513\n   0.101400 1  ABBA         Rx   d 4 30 CC 0C 00  Length = 230000 BitCount = 115 ID = 385\n"
            ),
            Some(1),
        ),
        (
            "ASC with CANFD lines of classic frames",
            format!(
                "{ASC}   0.001000 CANFD   1 Tx        201                                   0 0 3  3 3D 30 00   130000  130        0 0 0 0 0 0\n   \
                 0.001400 CANFD   1 Rx        181  DriveTx                          0 0 4  4 30 CD 0C 00   130000  130        0 0 0 0 0 0\n   \
                 0.101000 CANFD   1 Tx        201                                   0 0 3  3 3D 30 00   130000  130        0 0 0 0 0 0\n   \
                 0.101400 CANFD   1 Rx        181                                   0 0 4  4 30 CC 0C 00   130000  130        0 0 0 0 0 0\n"
            ),
            Some(1),
        ),
    ]
}

fn read(text: &str, links: &[&str]) -> Result<ImportedCapture, String> {
    read_with(text.as_bytes(), &settings(links)).map_err(|error| error.to_string())
}

fn shown(imported: &ImportedCapture) -> Vec<String> {
    let frames = imported.capture.traces[0].channels[0].frames().iter();
    frames.map(|frame| frame.frame.to_string()).collect()
}

#[test]
fn every_log_has_the_same_frames_at_their_times() {
    let logs = logs();
    for (name, text, exact) in &logs {
        let read = read(text, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(shown(&read), FRAMES, "{name}");
        assert_eq!(
            read.capture.timed,
            exact.is_some(),
            "{name}: {:?}",
            read.notes
        );
        let (reference, _) = (&logs[0], ());
        let reference = super::super::read(reference.1.as_bytes(), None).expect("a log");
        let exact = Span::from_micros(exact.unwrap_or_default());
        let compared = frame_diff(&reference, &read.capture, exact);
        assert!(
            compared.same(),
            "{name}: {}",
            compared.show(["own", "reference"])
        );
        // A heading may have more bytes in it than a frame, and the file is known by its first part alone.
        assert!(
            super::format(&text.as_bytes()[..text.len().min(300)]).is_some(),
            "{name}"
        );
    }
}

/// Times on a screen that go back again and again count from the frame before.
#[test]
fn differences_of_times_are_added() {
    let line = |time: &str| format!(" ({time})  can0  201   [3]  3D 30 00\n");
    let mut text = line("000.000000");
    for _ in 0..3 {
        text += &line("000.000400");
        text += &line("000.099600");
    }
    let read = read(&text, &[]).expect("a log");
    let frames = read.capture.traces[0].channels[0].frames();
    assert!(read.capture.timed);
    assert_eq!(frames[6].at.since(frames[0].at), Span::from_millis(300));
    assert!(read.notes[0].contains("-td"), "{:?}", read.notes);
}

/// A frame of CAN FD on the chosen channel is refused with its line, and does not matter on another.
#[test]
fn a_frame_of_can_fd_on_another_channel_does_not_matter() {
    let candump = "(1.0) can0 201#3D3000\n(1.1) can1 123##1AA\n";
    let screen = "  can0  201   [3]  3D 30 00\n  can1  123  [03]  01 02 03\n";
    let asc = format!(
        "{ASC}   0.001 can0 201 Rx d 3 3D 30 00\n   0.002 CANFD can1 Rx 123 1 0 3 3 01 02 03 130000 130 3000 0 0 0 0 0\n"
    );
    let trc = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1.0 DT can0 0201 Rx - 3 3D 30 00\n 2 2.0 FB can1 0123 Rx - 9 01 02\n";
    let gvret = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n1,201,false,Rx,can0,3,3D,30,00\n2,123,false,Rx,can1,12,1,2,3,4,5,6,7,8,9,A,B,C\n";
    for text in [candump, screen, &asc, trc, gvret] {
        let imported = read(text, &["bus=can0"]).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(shown(&imported), FRAMES[..1], "{text}");
        let error = read(text, &["bus=can1"]).expect_err("a frame of CAN FD");
        assert!(
            error.contains("line ") && error.contains("CAN FD"),
            "{error}"
        );
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_line() {
    let screen = "  can0  201   [3]  3D 30 00\n";
    let busmaster = format!("{BUSMASTER}23:59:59:9500 Tx 1 0x201 s 3 3D 30 00\n");
    for (text, place, words) in [
        (
            format!("{screen}  can0  181   [4]  30 CD 0C\n"),
            "line 2",
            "4 data bytes expected",
        ),
        (
            format!("{screen}  can0  FFF   [1]  30\n"),
            "line 2",
            "too large",
        ),
        (
            format!("{screen}  can0  181   [4]  30CD0C00\n"),
            "line 2",
            "data bytes expected",
        ),
        (
            format!("{screen}and more\n{screen}"),
            "line 2",
            "is expected",
        ),
        (
            format!("{busmaster}23:59:59:9500 Tx 1 MODE s 3 3D 30 00\n"),
            "line 7",
            "`MODE` is no identifier",
        ),
        (
            format!("{busmaster}23:59:59:9500 Tx 1 0x201 q 3 3D 30 00\n"),
            "line 7",
            "`q` is no type",
        ),
        (
            ";$FILEVERSION=3.0\n".to_owned(),
            "line 1",
            "versions 1.0 to 2.1",
        ),
        (
            ";$FILEVERSION=1.1\n 1) x Rx 0201 3 3D 30 00\n".to_owned(),
            "line 2",
            "milliseconds",
        ),
        (
            "Chn Identifier Flg DLC D0\n 0 513 3 61 48 0 1.0 R\n".to_owned(),
            "line 2",
            "not in hexadecimal",
        ),
        (
            "1.5 R11 201 1 2 3 4 5 6 7 8 9\n".to_owned(),
            "line 1",
            "at most 8",
        ),
        (
            format!("{ASC} 0.1 1 DriveRx Rx d 1 3D\n"),
            "line 4",
            "numeric identifiers",
        ),
        (
            format!("{ASC} 0.1 CANFD 1 Rx 201 0 0 3 3 3D 30\n"),
            "line 4",
            "CAN FD",
        ),
    ] {
        let error = read(&text, &[]).expect_err(&text);
        assert!(error.starts_with(place) && error.contains(words), "{error}");
    }
}

#[test]
fn what_stands_behind_the_last_frame_is_counted() {
    let text =
        "```\n> can0  201   [3]  3D 30 00\n> can0  181   [4]  30 CD 0C 00\n```\nroot@box7:~# \n";
    let imported = read(text, &[]).expect("a log");
    assert_eq!(shown(&imported), FRAMES[..2]);
    let mut notes = imported.notes.iter();
    assert!(notes.any(|note| note.starts_with("2 lines behind the last frame")));
}

/// Frames that candump has dropped: what differs accuses no drive.
#[test]
fn dropped_frames_are_noted() {
    let text = "  can0  201   [3]  3D 30 00\nDROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n  can0  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n\
                \tcontroller-problem{rx-overflow}\n  can0  181   [4]  30 CD 0C 00\n";
    let imported = read(text, &[]).expect("a log");
    assert_eq!(shown(&imported), FRAMES[..2]);
    assert!(imported.lost);
    let notes = imported.notes.join("\n");
    assert!(
        notes.contains("dropped 3") && notes.contains("1 error frame not read"),
        "{notes}"
    );
}

/// Any bytes in any line give frames or an error: each log with each of its characters replaced.
#[test]
fn damaged_logs_are_refused_or_read() {
    for (_, text, _) in logs() {
        for place in (0..text.len()).step_by(3) {
            for byte in *b"9,#\n(\xFF" {
                let mut bytes = text.clone().into_bytes();
                bytes[place] = byte;
                let _any = read_with(&bytes, &ReadSettings::default());
            }
        }
    }
}
