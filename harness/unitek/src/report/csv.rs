//! A trace as a table for spreadsheets: a row a frame.
//!
//! | column | meaning |
//! |---|---|
//! | `t_ns` | when the last bit of the frame, or of the error frame that ended it, had passed, in nanoseconds since the start |
//! | `from` | `master` or the drive's number |
//! | `id` | the identifier in hexadecimal digits: three, or eight for 29 bits |
//! | `remote`, `dlc`, `data` | 1 for a remote frame; the length; the data bytes in hexadecimal digits |
//! | `ended` | empty, `lost`, or the error that ended the frame |
//! | `meaning` | what the frame says, as in the table |

use super::meaning;
use harness_sim::record::{FrameEnd, Trace};
use std::io::Write;

/// Writes the table.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    writeln!(out, "t_ns,from,id,remote,dlc,data,ended,meaning")?;
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    for line_frame in channels.flat_map(|channel| channel.frames()) {
        let frame = &line_frame.frame;
        let from = line_frame
            .from
            .map_or("master".to_owned(), |drive| drive.to_string());
        let data: String = frame
            .data()
            .iter()
            .map(|byte| format!("{byte:02X}"))
            .collect();
        let ended = match line_frame.ended {
            FrameEnd::Good => "",
            FrameEnd::Lost => "lost",
            FrameEnd::Error(error) => error.name(),
        };
        writeln!(
            out,
            "{},{from},{},{},{},{data},{ended},\"{}\"",
            line_frame.at.since_start().as_nanos(),
            frame.id(),
            u8::from(frame.is_remote()),
            frame.dlc(),
            meaning(frame, line_frame.from.is_some()).replace('"', "\"\"")
        )?;
    }
    out.flush()
}
