//! What the manual leaves open, as named properties of a drive with a default each.
//!
//! Only a physical drive can settle these. The profile [`ds`](Properties::default) reproduces every worked example of the manual;
//! [`fw472`](Properties::fw472) is the drive of the dump.

use crate::open_words::words;
use crate::time::Span;
use core::fmt;

words! {
    /// `map-reply`: the width of 40 and 8F in polled and cyclic replies (ex 8, App 7). The manual prints both.
    MapReply {
        #[default]
        Short "short",
        /// 32 bits, as wide as the dump prints the registers.
        Native "native",
    }
    /// `event-reply`: the width of 40 in an event frame (ex 10).
    EventReply {
        #[default]
        Native "native",
        AsMapReply "as-map-reply",
    }
    /// `dlc4`: what becomes of a frame with 4 bytes (5.1).
    Dlc4 {
        /// Read as one of 3 bytes.
        #[default]
        As3 "as3",
        Ignore "ignore",
    }
    /// `short-write`: what 16 bits do to the upper half of a register of 32 (App 1).
    ShortWrite {
        /// Extended by sign or by zero.
        #[default]
        Extend "extend",
        KeepHigh "keep-high",
    }
    /// `table-full`: what becomes of a ninth cyclic register (ex 9, App 8).
    TableFull {
        #[default]
        Refuse "refuse",
        /// It takes the place of the one that was requested longest ago.
        Oldest "oldest",
    }
    /// `cyclic-first`: when the first cyclic frame is sent (5.2).
    CyclicFirst {
        /// One interval after the request.
        #[default]
        After "after",
        /// At the request, as for a single reply.
        AtOnce "at-once",
    }
    /// `oneshot-stops`: whether a single request ends the cycle of its register (5.2).
    OneshotStops {
        #[default]
        No "no",
        Yes "yes",
    }
    /// `id-change`: when new identifiers in 68 and 69 are used (ex 1).
    IdChange {
        #[default]
        Immediate "immediate",
        /// At the next power-up, if they were stored.
        Restart "restart",
    }
    /// `id-range`: which identifiers 68 and 69 take (3.1, 4.1).
    IdRange {
        /// 001 to 7FF.
        #[default]
        Any "any",
        /// 201 to 27F in 68 and 181 to 1FF in 69.
        Printed "printed",
    }
    /// `event-mask`: STATUS_MASK (52) after power-up (ex 10).
    EventMask {
        /// Bits 12 and 13.
        #[default]
        CalTol "3000",
        /// As in the dump.
        Dump "F811",
        /// As printed in ex 10.
        Printed "0030",
    }
    /// `status-bits`: which bits of STATUS (40) there are (ex 8, 10, 10-1).
    StatusBits {
        /// Those that the manual names.
        #[default]
        Printed "printed",
        /// Bits 4, 6, 9, 11 and 14 as well.
        Full "full",
    }
    /// `unknown-register`: what a read of an unassigned register gives (dump).
    UnknownRegister {
        /// Its contents, FACE.
        #[default]
        Face "face",
        Silent "silent",
    }
    /// `can-counters`: whether 95, 96 and 97 count frames (dump).
    CanCounters {
        #[default]
        Frozen "frozen",
        /// 95 counts the frames accepted, 96 those sent, 97 those ignored although they have the drive's identifier.
        Live "live",
    }
    /// `lock-at-power-up`: whether MODE bit 2 is set at power-up (ex 11, 12).
    LockAtPowerUp {
        #[default]
        No "no",
        Yes "yes",
    }
    /// `lock-clears-command`: whether a lock sets 31 and 90 to 0 (ex 2).
    LockClearsCommand {
        #[default]
        No "no",
        Yes "yes",
    }
    /// `power-up-mode`: the control mode before any command (ex 8, dump).
    PowerUpMode {
        #[default]
        Speed "speed",
        Position "position",
    }
    /// `wide-replies`: how 16 bits become 32 in a reply while bit 8 of DC is set (App 3).
    WideReplies {
        /// By the sign of the register.
        #[default]
        Sign "sign",
        Zero "zero",
    }
    /// `interval-accuracy`: when cyclic frames are sent (5.2, ex 9).
    IntervalAccuracy {
        /// Each in its millisecond.
        #[default]
        Exact "exact",
        /// Each second one 1 ms late, so that the mean is exact. An interval of 1 ms leaves no room for that.
        OneScan "one-scan",
    }
    /// `event-edges`: which changes of STATUS are sent by event (ex 10, 10-1).
    EventEdges {
        #[default]
        Both "both",
        /// A selected bit becomes 1.
        Rising "rising",
        /// A selected bit becomes 0.
        Falling "falling",
    }
    /// `event-at-set-up`: whether STATUS is sent when MODE bit 4 is set while a selected bit is 1 (5.2 item 3).
    EventAtSetUp {
        #[default]
        None "none",
        /// In the next millisecond.
        AtOnce "at-once",
    }
    /// `rate-change`: when a new bit timing in 73 is used (3.1).
    RateChange {
        /// At the next power-up, if it was stored.
        #[default]
        Restart "restart",
        Immediate "immediate",
    }
    /// `time-out-clear`: what clears a time-out of the bus (8E: dump; the lock: field, two teams quote the maker).
    TimeOutClear {
        /// A write of 8E.
        #[default]
        Cancel "cancel",
        /// A lock and its release (MODE bit 2 from 1 to 0), and 8E alone does not.
        Lock "lock",
    }
    /// `enable-after-lock`: whether a drive that was switched on, or was not ready, is enabled only by a lock and its release (ex 11; field,
    /// two teams quote the maker).
    EnableAfterLock {
        #[default]
        No "no",
        /// MODE bit 2 has to go from 1 to 0 while it is ready.
        Yes "yes",
    }
    /// `second-identifiers`: what the drive does with 88 and 89 (dump).
    SecondIdentifiers {
        /// It stores them.
        #[default]
        Stored "stored",
        /// It also receives on 88, and sends what is asked for there once on 89, or on 69 while 89 is 0.
        Immediate "immediate",
        /// The same from the next power-up on, if they were stored.
        Restart "restart",
    }
}

/// How a drive behaves where the manual does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Properties {
    /// `map-reply`.
    pub map_reply: MapReply,
    /// `event-reply`.
    pub event_reply: EventReply,
    /// `stuff`: the last byte of replies (2, ex 8).
    pub stuff: u8,
    /// `dlc4`.
    pub dlc4: Dlc4,
    /// `short-write`.
    pub short_write: ShortWrite,
    /// `table-full`.
    pub table_full: TableFull,
    /// `cyclic-first`.
    pub cyclic_first: CyclicFirst,
    /// `oneshot-stops`.
    pub oneshot_stops: OneshotStops,
    /// `id-change`.
    pub id_change: IdChange,
    /// `id-range`.
    pub id_range: IdRange,
    /// `event-mask`.
    pub event_mask: EventMask,
    /// `status-bits`.
    pub status_bits: StatusBits,
    /// `unknown-register`.
    pub unknown_register: UnknownRegister,
    /// `can-counters`.
    pub can_counters: CanCounters,
    /// `lock-at-power-up`.
    pub lock_at_power_up: LockAtPowerUp,
    /// `lock-clears-command`.
    pub lock_clears_command: LockClearsCommand,
    /// `power-up-mode`.
    pub power_up_mode: PowerUpMode,
    /// `wide-replies`.
    pub wide_replies: WideReplies,
    /// `interval-accuracy`.
    pub interval_accuracy: IntervalAccuracy,
    /// `event-edges`.
    pub event_edges: EventEdges,
    /// `event-at-set-up`.
    pub event_at_set_up: EventAtSetUp,
    /// `rate-change`.
    pub rate_change: RateChange,
    /// `time-out-clear`.
    pub time_out_clear: TimeOutClear,
    /// `enable-after-lock`.
    pub enable_after_lock: EnableAfterLock,
    /// `second-identifiers`.
    pub second_identifiers: SecondIdentifiers,
    /// `reply-delay`: from the end of a request to the begin of its reply on a free bus (ex 8).
    pub reply_delay: Span,
    /// `homing-time`: how long homing stands before it ends (ex 12); whole milliseconds.
    pub homing_time: Span,
}

impl Default for Properties {
    /// The profile `ds`.
    fn default() -> Self {
        Self {
            map_reply: MapReply::default(),
            event_reply: EventReply::default(),
            stuff: 0,
            dlc4: Dlc4::default(),
            short_write: ShortWrite::default(),
            table_full: TableFull::default(),
            cyclic_first: CyclicFirst::default(),
            oneshot_stops: OneshotStops::default(),
            id_change: IdChange::default(),
            id_range: IdRange::default(),
            event_mask: EventMask::default(),
            status_bits: StatusBits::default(),
            unknown_register: UnknownRegister::default(),
            can_counters: CanCounters::default(),
            lock_at_power_up: LockAtPowerUp::default(),
            lock_clears_command: LockClearsCommand::default(),
            power_up_mode: PowerUpMode::default(),
            wide_replies: WideReplies::default(),
            interval_accuracy: IntervalAccuracy::default(),
            event_edges: EventEdges::default(),
            event_at_set_up: EventAtSetUp::default(),
            rate_change: RateChange::default(),
            time_out_clear: TimeOutClear::default(),
            enable_after_lock: EnableAfterLock::default(),
            second_identifiers: SecondIdentifiers::default(),
            reply_delay: Span::ZERO,
            homing_time: Span::from_millis(500),
        }
    }
}

impl Properties {
    /// The profile `fw472`: the drive of the dump.
    #[must_use]
    pub fn fw472() -> Self {
        Self {
            map_reply: MapReply::Native,
            status_bits: StatusBits::Full,
            event_mask: EventMask::Dump,
            power_up_mode: PowerUpMode::Position,
            ..Self::default()
        }
    }

    /// The profile with this name.
    #[must_use]
    pub fn profile(name: &str) -> Option<Self> {
        match name {
            "ds" => Some(Self::default()),
            "fw472" => Some(Self::fw472()),
            _ => None,
        }
    }
}

/// The names of the profiles; the default comes first.
pub const PROFILES: [&str; 2] = ["ds", "fw472"];

/// What a property can be set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting<'a> {
    /// One of the property's words; for `stuff` two hexadecimal digits.
    Word(&'a str),
    /// A time.
    Time(Span),
}

/// What a property accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepts {
    /// One of these words; the default comes first.
    Words(&'static [&'static str]),
    /// A byte as two hexadecimal digits; the default is 00.
    Byte,
    /// A time up to the given one.
    TimeUpTo(Span),
}

/// A property as people see it.
#[derive(Clone, Copy, Debug)]
pub struct UnitekProperty {
    /// Its name in scenarios.
    pub name: &'static str,
    /// What it can be set to.
    pub accepts: Accepts,
    /// The section or example that leaves it open.
    pub section: &'static str,
    /// What it decides.
    pub about: &'static str,
    set: fn(&mut Properties, Setting<'_>) -> bool,
    get: fn(&Properties) -> CurrentSetting,
}

/// What a property is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSetting {
    /// One of the property's words.
    Word(&'static str),
    /// A byte.
    Byte(u8),
    /// A time.
    Time(Span),
}

impl fmt::Display for CurrentSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(word) => f.write_str(word),
            Self::Byte(byte) => write!(f, "{byte:02X}"),
            Self::Time(span) => match span.as_nanos() {
                whole if whole % 1_000_000 == 0 => write!(f, "{}ms", whole / 1_000_000),
                other => write!(f, "{}us", other / 1_000),
            },
        }
    }
}

impl UnitekProperty {
    /// What the property is of a drive.
    #[must_use]
    pub fn of_drive(&self, properties: &Properties) -> CurrentSetting {
        (self.get)(properties)
    }

    /// The property with this name.
    #[must_use]
    pub fn of(name: &str) -> Option<&'static Self> {
        PROPERTIES.iter().find(|property| property.name == name)
    }

    /// Sets the property; `false` if it does not accept this setting, and then nothing is changed.
    #[must_use]
    pub fn set(&self, properties: &mut Properties, setting: Setting<'_>) -> bool {
        (self.set)(properties, setting)
    }
}

/// One row a property.
macro_rules! properties {
    ($($name:literal $field:ident: $type:ident $section:literal $about:literal;)+) => {
        &[
            $(UnitekProperty {
                name: $name,
                accepts: properties!(@accepts $type),
                section: $section,
                about: $about,
                set: |properties, setting| {
                    let value = properties!(@value $type setting);
                    value.map(|value| properties.$field = value).is_some()
                },
                get: |properties| properties!(@get $type properties.$field),
            },)+
        ]
    };
    (@accepts Byte) => { Accepts::Byte };
    (@accepts Time) => { Accepts::TimeUpTo(LONGEST) };
    (@accepts $type:ident) => { Accepts::Words($type::WORDS) };
    (@get Byte $value:expr) => { CurrentSetting::Byte($value) };
    (@get Time $value:expr) => { CurrentSetting::Time($value) };
    (@get $type:ident $value:expr) => { CurrentSetting::Word($value.word()) };
    (@value Byte $setting:ident) => { byte($setting) };
    (@value Time $setting:ident) => { time($setting) };
    (@value $type:ident $setting:ident) => {
        match $setting {
            Setting::Word(word) => $type::from_word(word),
            Setting::Time(_) => None,
        }
    };
}

/// The longest time that a property accepts.
const LONGEST: Span = Span::from_millis(10_000);

fn byte(setting: Setting<'_>) -> Option<u8> {
    match setting {
        Setting::Word(word) if word.len() == 2 && word.bytes().all(|c| c.is_ascii_hexdigit()) => {
            u8::from_str_radix(word, 16).ok()
        }
        _ => None,
    }
}

fn time(setting: Setting<'_>) -> Option<Span> {
    match setting {
        Setting::Time(span) if span <= LONGEST => Some(span),
        _ => None,
    }
}

/// Every property.
#[rustfmt::skip]
pub const PROPERTIES: &[UnitekProperty] = properties! {
    "map-reply" map_reply: MapReply "App 7" "the width of polled and cyclic replies with 40 and 8F";
    "event-reply" event_reply: EventReply "ex 10" "the width of 40 in an event frame";
    "stuff" stuff: Byte "App 2" "the last byte of every reply";
    "dlc4" dlc4: Dlc4 "5.1" "a frame with 4 data bytes";
    "short-write" short_write: ShortWrite "App 1" "16 bits written to a register of 32";
    "table-full" table_full: TableFull "App 8" "a cyclic request for a ninth register";
    "cyclic-first" cyclic_first: CyclicFirst "5.2" "when the first cyclic frame is sent";
    "oneshot-stops" oneshot_stops: OneshotStops "5.2" "whether a single request ends the cycle of its register";
    "id-change" id_change: IdChange "ex 1" "when new identifiers in 68 and 69 are used";
    "id-range" id_range: IdRange "3.1" "which identifiers 68 and 69 take";
    "event-mask" event_mask: EventMask "ex 10" "the contents of 52 after power-up";
    "status-bits" status_bits: StatusBits "ex 8" "which bits STATUS has";
    "unknown-register" unknown_register: UnknownRegister "dump" "a read of a register that nothing is assigned to";
    "can-counters" can_counters: CanCounters "dump" "whether 95, 96 and 97 count frames";
    "lock-at-power-up" lock_at_power_up: LockAtPowerUp "ex 11" "whether the drive is locked after power-up";
    "lock-clears-command" lock_clears_command: LockClearsCommand "ex 2" "whether a lock sets 31 and 90 to 0";
    "power-up-mode" power_up_mode: PowerUpMode "ex 8" "the control mode before any command";
    "reply-delay" reply_delay: Time "ex 8" "how long after a request its reply begins";
    "homing-time" homing_time: Time "ex 12" "how long homing takes";
    "wide-replies" wide_replies: WideReplies "App 3" "how 16 bits become 32 while bit 8 of DC is set";
    "interval-accuracy" interval_accuracy: IntervalAccuracy "ex 9" "when cyclic frames are sent";
    "event-edges" event_edges: EventEdges "ex 10" "which changes of STATUS are sent by event";
    "event-at-set-up" event_at_set_up: EventAtSetUp "5.2" "whether a bit that is set when MODE bit 4 is set is an event";
    "rate-change" rate_change: RateChange "3.1" "when a new bit timing in 73 is used";
    "second-identifiers" second_identifiers: SecondIdentifiers "dump" "what the drive does with 88 and 89";
    "time-out-clear" time_out_clear: TimeOutClear "dump" "what clears a time-out of the bus";
    "enable-after-lock" enable_after_lock: EnableAfterLock "ex 11" "whether a drive that was not ready is enabled only after a lock and its release";
};
