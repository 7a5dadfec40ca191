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
use harness_sim::record::Trace;
use std::io::Write;

/// Writes the table.
///
/// # Errors
/// Those of `out`.
pub(crate) fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    writeln!(out, "t_ns,from,to,bytes,error,service,meaning")?;
    for trace in traces {
        let mut reader = Reader::default();
        for own in said(trace) {
            let words = reader.read(&own);
            let from = own.from.map_or("master".to_owned(), |own| own.to_string());
            let to = words.to.map_or(String::new(), |own| own.to_string());
            let bytes: String = own.octets.iter().map(|own| format!("{own:02X}")).collect();
            let error = own.error;
            let error = error.map_or(String::new(), |(place, error)| format!("{error} {place}"));
            writeln!(
                out,
                "{},{from},{to},{bytes},{error},\"{}\",\"{}\"",
                own.at.since_start().as_nanos(),
                words.service,
                words.meaning.replace('"', "\"\"")
            )?;
        }
    }
    out.flush()
}
