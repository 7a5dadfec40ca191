//! A trace as a table for spreadsheets: a row a telegram.
//!
//! | column | meaning |
//! |---|---|
//! | `t_ns` | when the last stop bit of the telegram had passed, in nanoseconds since the start |
//! | `from`, `to` | `master` or the slave's address; the address that the telegram names, or empty |
//! | `bytes` | the octets as they arrived, in hexadecimal digits |
//! | `error` | empty, or the first line error and the number of its octet: `parity 3` |
//! | `service`, `meaning` | as in the table |

use super::words::Reader;
use harness_bench::capture::runs::said;
use harness_bench::scenario::run::record::hex;
use harness_sim::record::Trace;
use std::io::Write;

/// Writes the table.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    writeln!(out, "t_ns,from,to,bytes,error,service,meaning")?;
    for trace in traces {
        let mut reader = Reader::default();
        for said in said(trace) {
            let words = reader.read(&said);
            let from = said.from.map(|slave| slave.to_string());
            let from = from.unwrap_or("master".to_owned());
            let to = words.to.map(|slave| slave.to_string());
            let to = to.unwrap_or_default();
            let bytes = hex(&said.octets);
            let error = said.error.map(|(place, error)| format!("{error} {place}"));
            let error = error.unwrap_or_default();
            writeln!(
                out,
                "{},{from},{to},{bytes},{error},\"{}\",\"{}\"",
                said.at.since_start().as_nanos(),
                words.service,
                words.meaning.replace('"', "\"\"")
            )?;
        }
    }
    out.flush()
}
