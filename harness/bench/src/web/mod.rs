//! The live page: a small HTTP/1.1 server on threads, for a browser on this machine.
//!
//! | request | what it gives |
//! |---|---|
//! | `GET /` | the page: one file, without a secret in it |
//! | `GET /events` | one stream of numbered events (`text/event-stream`); `Last-Event-ID` goes on after an event |
//! | `POST /fault` | a fault: `{"place":1,"fault":0}`, places and faults by their numbers in the scene |
//! | `POST /play` | a short conversation of the bench's own: `{"script":0}` |
//!
//! A page that injects faults can be driven by any web site that its user visits, although it listens at 127.0.0.1: such a site may
//! point a name of its own at this machine, or send a form here. So `gate` wants an exact `Host`, an exact `Origin`, the type
//! `application/json`, and a token that only the address printed at the start holds, after its `#`. The events need the token too.
//!
//! A bench shows itself by a [`LiveView`]. Nothing is recorded while no page is open. `feed` bounds what waits for slow readers.

pub mod feed;
pub mod gate;
pub mod page;
pub mod request;
pub mod server;
pub mod view;

pub(crate) use server::LivePage;
pub use view::ARROWS;
pub use view::{
    FaultPlace, LiveCell, LiveNews, LiveOrder, LivePicture, LiveRow, LiveScene, LiveView,
    MAX_CELLS, MAX_ROWS,
};
