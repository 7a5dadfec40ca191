//! What the manual leaves open, as named properties of an inverter with a default each.
//!
//! Only a physical drive can settle these. The defaults reproduce every number that the manual prints.

use crate::open_words::words;

words! {
    /// `pzd-invalid`: what happens to the process words in force when a control word with bit 10 = 0 comes (3.2.1).
    PzdInvalid {
        #[default]
        Hold "hold",
        SetpointOnly "setpoint-only",
        Stop "stop",
    }
    /// `timeout-counts`: what restarts the bus time-out 1625 (2.5.1).
    TimeoutCounts {
        #[default]
        ValidPzd "valid-pzd",
        AnyDataExchange "any-data-exchange",
    }
    /// `watchdog-action`: what the inverter does when the DP watchdog expires (2.6).
    WatchdogAction {
        #[default]
        Keep "keep",
        Stop "stop",
    }
    /// `leave-dx-wrong-length`: a Data_Exchange of the wrong length (EN 2).
    LeaveDxWrongLength {
        #[default]
        RsAndWaitPrm "rs-and-wait-prm",
        RsOnly "rs-only",
    }
    /// `user-prm`: user data behind Set_Prm (GSD).
    UserPrm {
        #[default]
        Fault "fault",
        Ignore "ignore",
    }
    /// `chk-cfg-early`: Chk_Cfg before Set_Prm (EN 2).
    ChkCfgEarly {
        #[default]
        Rs "rs",
        Sc "sc",
    }
    /// `sda-ident-lsap`: requests SDA, ident and LSAP status (EN 1).
    SdaIdentLsap {
        #[default]
        Rs "rs",
        Silent "silent",
    }
    /// `foreign-prm`: Set_Prm of another master while the slave has one (EN 2).
    ForeignPrm {
        #[default]
        Sc "sc",
        Rs "rs",
    }
    /// `cfg-follows-ppo-type`: which configurations Chk_Cfg accepts (3.1).
    CfgFollowsPpoType {
        #[default]
        Yes "yes",
        AnyPpo "any-ppo",
    }
    /// `ext-diag`: when the diagnosis has its extension (2.6).
    ExtDiag {
        #[default]
        WhenPresent "when-present",
        Always "always",
    }
    /// `sync-without-request`: Sync and Freeze that Set_Prm did not ask for (EN 2).
    SyncWithoutRequest {
        #[default]
        Ignored "ignored",
        Obeyed "obeyed",
    }
    /// `autobaud`: whether the first telegram after power-up is answered (GSD).
    Autobaud {
        #[default]
        AtOnce "at-once",
        FirstTelegramLost "first-telegram-lost",
    }
    /// `reinit`: when a change of 1619, 1622 or 1624 takes effect (2.5.1).
    Reinit {
        #[default]
        AtOnce "at-once",
        AtPowerUp "at-power-up",
    }
    /// `address-range`: which addresses 1624 takes (2.5.1).
    AddressRange {
        #[default]
        From1 "1..126",
        From2 "2..126",
    }
    /// `load-default-value`: which value of 970 loads the factory settings (4.1.3).
    LoadDefaultValue {
        #[default]
        Zero "0",
        One "1",
    }
    /// `task-new-when`: which octets make a task new (3.4.1).
    TaskNewWhen {
        #[default]
        AnyByte "any-byte",
        PkeOrInd "pke-or-ind",
    }
    /// `negative-pwe1`: PWE1 of a word below 0 (3.4.3).
    NegativePwe1 {
        #[default]
        Zero "0000",
        Extended "FFFF",
    }
    /// `pwe1-of-word-task`: PWE1 of a task that carries a word (3.4.3).
    Pwe1OfWordTask {
        #[default]
        Ignored "ignored",
        Checked "checked",
    }
    /// `ind-low-byte`: a low octet of IND other than 0 (3.4.2).
    IndLowByte {
        #[default]
        Ignored "ignored",
        Error3 "error-3",
    }
    /// `subindex-bits`: which bits of IND are the sub-index (3.4.2).
    SubindexBits {
        #[default]
        From8 "8..15",
        From7 "7..15",
    }
    /// `plain-task-subindex`: IND of tasks 1, 2 and 3 (3.4.2).
    PlainTaskSubindex {
        #[default]
        Used "used",
        Ignored "ignored",
    }
    /// `width-error`: a word task on a double word, or the reverse (3.4.1).
    WidthError {
        #[default]
        Task "201",
        DataType "5",
    }
    /// `online-error`: a change of a parameter without flag O while the inverter runs (5).
    OnlineError {
        #[default]
        ReadOnly "1",
        Running "17",
    }
    /// `ppo1-double-words`: double words under PPO1 (3.4.1).
    Ppo1DoubleWords {
        #[default]
        Refused "refused",
        Allowed "allowed",
    }
    /// `description-error-order`: task 4 or 5 on an unknown number (3.4.1).
    DescriptionErrorOrder {
        #[default]
        NumberFirst "number-first",
        TaskFirst "task-first",
    }
    /// `spm`: a task with bit 11 (3.4.1).
    Spm {
        #[default]
        Ignored "ignored",
        Error "error",
    }
    /// `967-write`: a change of the control word through the parameter channel (4.1.3).
    ControlWrite {
        #[default]
        Refused "refused",
        Taken "taken",
    }
    /// `1732-write`: a change of 1732 or 1733 (5.6).
    PositionLimitWrite {
        #[default]
        Taken "taken",
        Refused "refused",
    }
    /// `947-elements`: the elements of 947 (4.1.3).
    ErrorElements {
        #[default]
        Same "same",
        NewestFirst "newest-first",
    }
    /// `rd-inp-under-freeze`: what RD_Inp reads under Freeze (EN 2).
    RdInpUnderFreeze {
        #[default]
        Live "live",
        Frozen "frozen",
    }
    /// `diag-flag-cleared-by`: whose Slave_Diag takes the report of a diagnosis back (EN 2).
    DiagFlagClearedBy {
        #[default]
        AnyMaster "any-master",
        Own "own",
    }
    /// `bit4-ramp`: how STW bit 4 = 0 takes the frequency to 0 (3.2.1).
    Bit4Ramp {
        #[default]
        QuickStop "quick-stop",
        Deceleration "deceleration",
        AtOnce "at-once",
    }
    /// `off1-beats-disable`: OFF1 and disable operation in one control word (3.3).
    Off1BeatsDisable {
        #[default]
        Yes "yes",
        No "no",
    }
    /// `off1-zsw-while-ramping`: bits 2 to 0 of ZSW while OFF1 ramps down (3.3).
    Off1ZswWhileRamping {
        #[default]
        Enabled "7",
        Ready "3",
        ReadyToStart "1",
    }
    /// `zsw1-in-qs-fr`: ZSW bit 1 during a quick stop and a fault reaction (3.2.2).
    Zsw1InQsFr {
        #[default]
        One "1",
        Zero "0",
    }
    /// `timeout-with-1614`: the bus time-out with 1614 = 1 (2.5.1).
    TimeoutWith1614 {
        #[default]
        Ramp "ramp",
        Off "off",
    }
    /// `both-directions`: STW bits 11 and 12 both 1 (3.2.1).
    BothDirections {
        #[default]
        Clockwise "clockwise",
        Stop "stop",
        Inverted "inverted",
    }
    /// `over-100`: a setpoint above 100 % (3.2.3).
    Over100 {
        #[default]
        Limited "limited",
        Allowed "allowed",
    }
    /// `position-words`: which words carry a position of 32 bits (3.2.3).
    PositionWords {
        #[default]
        HswHigh "hsw-high",
        Reversed "reversed",
    }
    /// `zsw8`: when ZSW bit 8 compares actual value and setpoint (3.2.2).
    Zsw8 {
        #[default]
        Always "always",
        OnlyWhenEnabled "only-when-enabled",
    }
    /// `zsw9`: when ZSW bit 9 is 1 (3.2.2).
    Zsw9 {
        #[default]
        ByInterface "by-interface",
        Always "always",
    }
    /// `zsw10`: what ZSW bit 10 shows (3.2.2).
    Zsw10 {
        #[default]
        Relay2 "relay-2",
        SetpointReached "setpoint-reached",
    }
    /// `zsw11-at-rest`: ZSW bit 11 of a drive at rest (3.2.2).
    Zsw11AtRest {
        #[default]
        One "1",
        Zero "0",
    }
    /// `timeout-exactly`: a valid PZD at the very instant at which 1625 expires (2.5.1).
    TimeoutExactly {
        #[default]
        Expires "expires",
        Survives "survives",
    }
    /// `initial-zsw-4-5`: ZSW bits 4 and 5 before the first valid control word (3.2.2).
    InitialZsw45 {
        #[default]
        One "1",
        Zero "0",
    }
}

/// How an inverter behaves where the manual does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Properties {
    /// `pzd-invalid`.
    pub pzd_invalid: PzdInvalid,
    /// `timeout-counts`.
    pub timeout_counts: TimeoutCounts,
    /// `watchdog-action`.
    pub watchdog_action: WatchdogAction,
    /// `leave-dx-wrong-length`.
    pub leave_dx_wrong_length: LeaveDxWrongLength,
    /// `user-prm`.
    pub user_prm: UserPrm,
    /// `chk-cfg-early`.
    pub chk_cfg_early: ChkCfgEarly,
    /// `sda-ident-lsap`.
    pub sda_ident_lsap: SdaIdentLsap,
    /// `foreign-prm`.
    pub foreign_prm: ForeignPrm,
    /// `cfg-follows-ppo-type`.
    pub cfg_follows_ppo_type: CfgFollowsPpoType,
    /// `ext-diag`.
    pub ext_diag: ExtDiag,
    /// `sync-without-request`.
    pub sync_without_request: SyncWithoutRequest,
    /// `autobaud`.
    pub autobaud: Autobaud,
    /// `reinit`.
    pub reinit: Reinit,
    /// `address-range`.
    pub address_range: AddressRange,
    /// `load-default-value`.
    pub load_default_value: LoadDefaultValue,
    /// `pkw-latency`: after how many exchanges an answer of the parameter channel comes (3.4.1); 1 to 20.
    pub pkw_latency: u8,
    /// `pzd-latency`: after how many exchanges the process data show a reaction (3.3); 1 to 20.
    pub pzd_latency: u8,
    /// `task-new-when`.
    pub task_new_when: TaskNewWhen,
    /// `negative-pwe1`.
    pub negative_pwe1: NegativePwe1,
    /// `pwe1-of-word-task`.
    pub pwe1_of_word_task: Pwe1OfWordTask,
    /// `ind-low-byte`.
    pub ind_low_byte: IndLowByte,
    /// `subindex-bits`.
    pub subindex_bits: SubindexBits,
    /// `plain-task-subindex`.
    pub plain_task_subindex: PlainTaskSubindex,
    /// `position-count`: how many elements 1716 and 1717 have (5.6); 1 to 64.
    pub position_count: u8,
    /// `width-error`.
    pub width_error: WidthError,
    /// `online-error`.
    pub online_error: OnlineError,
    /// `ppo1-double-words`.
    pub ppo1_double_words: Ppo1DoubleWords,
    /// `description-error-order`.
    pub description_error_order: DescriptionErrorOrder,
    /// `spm`.
    pub spm: Spm,
    /// `967-write`.
    pub control_write: ControlWrite,
    /// `1732-write`.
    pub position_limit_write: PositionLimitWrite,
    /// `947-elements`.
    pub error_elements: ErrorElements,
    /// `rd-inp-under-freeze`.
    pub rd_inp_under_freeze: RdInpUnderFreeze,
    /// `diag-flag-cleared-by`.
    pub diag_flag_cleared_by: DiagFlagClearedBy,
    /// `bit4-ramp`.
    pub bit4_ramp: Bit4Ramp,
    /// `off1-beats-disable`.
    pub off1_beats_disable: Off1BeatsDisable,
    /// `off1-zsw-while-ramping`.
    pub off1_zsw_while_ramping: Off1ZswWhileRamping,
    /// `zsw1-in-qs-fr`.
    pub zsw1_in_qs_fr: Zsw1InQsFr,
    /// `timeout-with-1614`.
    pub timeout_with_1614: TimeoutWith1614,
    /// `both-directions`.
    pub both_directions: BothDirections,
    /// `over-100`.
    pub over_100: Over100,
    /// `position-words`.
    pub position_words: PositionWords,
    /// `zsw8`.
    pub zsw8: Zsw8,
    /// `zsw9`.
    pub zsw9: Zsw9,
    /// `zsw10`.
    pub zsw10: Zsw10,
    /// `zsw11-at-rest`.
    pub zsw11_at_rest: Zsw11AtRest,
    /// `timeout-exactly`.
    pub timeout_exactly: TimeoutExactly,
    /// `initial-zsw-4-5`.
    pub initial_zsw_4_5: InitialZsw45,
}

impl Default for Properties {
    fn default() -> Self {
        Self {
            pzd_invalid: PzdInvalid::default(),
            timeout_counts: TimeoutCounts::default(),
            watchdog_action: WatchdogAction::default(),
            leave_dx_wrong_length: LeaveDxWrongLength::default(),
            user_prm: UserPrm::default(),
            chk_cfg_early: ChkCfgEarly::default(),
            sda_ident_lsap: SdaIdentLsap::default(),
            foreign_prm: ForeignPrm::default(),
            cfg_follows_ppo_type: CfgFollowsPpoType::default(),
            ext_diag: ExtDiag::default(),
            sync_without_request: SyncWithoutRequest::default(),
            autobaud: Autobaud::default(),
            reinit: Reinit::default(),
            address_range: AddressRange::default(),
            load_default_value: LoadDefaultValue::default(),
            pkw_latency: 2,
            pzd_latency: 1,
            task_new_when: TaskNewWhen::default(),
            negative_pwe1: NegativePwe1::default(),
            pwe1_of_word_task: Pwe1OfWordTask::default(),
            ind_low_byte: IndLowByte::default(),
            subindex_bits: SubindexBits::default(),
            plain_task_subindex: PlainTaskSubindex::default(),
            position_count: 64,
            width_error: WidthError::default(),
            online_error: OnlineError::default(),
            ppo1_double_words: Ppo1DoubleWords::default(),
            description_error_order: DescriptionErrorOrder::default(),
            spm: Spm::default(),
            control_write: ControlWrite::default(),
            position_limit_write: PositionLimitWrite::default(),
            error_elements: ErrorElements::default(),
            rd_inp_under_freeze: RdInpUnderFreeze::default(),
            diag_flag_cleared_by: DiagFlagClearedBy::default(),
            bit4_ramp: Bit4Ramp::default(),
            off1_beats_disable: Off1BeatsDisable::default(),
            off1_zsw_while_ramping: Off1ZswWhileRamping::default(),
            zsw1_in_qs_fr: Zsw1InQsFr::default(),
            timeout_with_1614: TimeoutWith1614::default(),
            both_directions: BothDirections::default(),
            over_100: Over100::default(),
            position_words: PositionWords::default(),
            zsw8: Zsw8::default(),
            zsw9: Zsw9::default(),
            zsw10: Zsw10::default(),
            zsw11_at_rest: Zsw11AtRest::default(),
            timeout_exactly: TimeoutExactly::default(),
            initial_zsw_4_5: InitialZsw45::default(),
        }
    }
}

/// What a property accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choices {
    /// One of these words; the default comes first.
    Words(&'static [&'static str]),
    /// A whole number.
    Count {
        /// The lowest.
        least: u8,
        /// The default.
        default: u8,
        /// The highest.
        most: u8,
    },
}

/// A property as people see it.
#[derive(Clone, Copy, Debug)]
pub struct NordacProperty {
    /// Its name in scenarios.
    pub name: &'static str,
    /// What it can be set to.
    pub accepts: Choices,
    /// The section that leaves it open: of the NORDAC manual, its GSD, or the bus standard (EN).
    pub section: &'static str,
    /// What it decides.
    pub about: &'static str,
    set: fn(&mut Properties, &str) -> bool,
}

impl NordacProperty {
    /// The property with this name.
    #[must_use]
    pub fn of(name: &str) -> Option<&'static Self> {
        PROPERTIES.iter().find(|property| property.name == name)
    }

    /// Sets the property; `false` if it does not accept this word or number, and then nothing is changed.
    #[must_use]
    pub fn set(&self, properties: &mut Properties, word: &str) -> bool {
        (self.set)(properties, word)
    }
}

/// One row a property: name, field, type (or lowest, default and highest number), section, what it decides.
macro_rules! properties {
    ($($name:literal $field:ident: $type:ident $([$least:literal $default:literal $most:literal])? $section:literal $about:literal;)+) => {
        &[
            $(NordacProperty {
                name: $name,
                accepts: properties!(@accepts $type $($least $default $most)?),
                section: $section,
                about: $about,
                set: |properties, word| {
                    let value = properties!(@value word $type $($least $most)?);
                    value.map(|value| properties.$field = value).is_some()
                },
            },)+
        ]
    };
    (@accepts Count $least:literal $default:literal $most:literal) => {
        Choices::Count { least: $least, default: $default, most: $most }
    };
    (@accepts $type:ident) => { Choices::Words($type::WORDS) };
    (@value $word:ident Count $least:literal $most:literal) => { count($word, $least, $most) };
    (@value $word:ident $type:ident) => { $type::from_word($word) };
}

fn count(word: &str, least: u8, most: u8) -> Option<u8> {
    let plain = word.bytes().all(|c| c.is_ascii_digit());
    let number = plain.then(|| word.parse().ok()).flatten();
    number.filter(|number| (least..=most).contains(number))
}

/// Every property.
#[rustfmt::skip]
pub const PROPERTIES: &[NordacProperty] = properties! {
    "pzd-invalid" pzd_invalid: PzdInvalid "3.2.1" "what happens to the process words in force when a control word with bit 10 = 0 comes";
    "timeout-counts" timeout_counts: TimeoutCounts "2.5.1" "what restarts the bus time-out 1625";
    "watchdog-action" watchdog_action: WatchdogAction "2.6" "what the inverter does when the DP watchdog expires";
    "leave-dx-wrong-length" leave_dx_wrong_length: LeaveDxWrongLength "EN 2" "a Data_Exchange of the wrong length";
    "user-prm" user_prm: UserPrm "GSD" "user data behind Set_Prm";
    "chk-cfg-early" chk_cfg_early: ChkCfgEarly "EN 2" "Chk_Cfg before Set_Prm";
    "sda-ident-lsap" sda_ident_lsap: SdaIdentLsap "EN 1" "requests SDA, ident and LSAP status";
    "foreign-prm" foreign_prm: ForeignPrm "EN 2" "Set_Prm of another master while the slave has one";
    "cfg-follows-ppo-type" cfg_follows_ppo_type: CfgFollowsPpoType "3.1" "which configurations Chk_Cfg accepts";
    "ext-diag" ext_diag: ExtDiag "2.6" "when the diagnosis has its extension";
    "sync-without-request" sync_without_request: SyncWithoutRequest "EN 2" "Sync and Freeze that Set_Prm did not ask for";
    "autobaud" autobaud: Autobaud "GSD" "whether the first telegram after power-up is answered";
    "reinit" reinit: Reinit "2.5.1" "when a change of 1619, 1622 or 1624 takes effect";
    "address-range" address_range: AddressRange "2.5.1" "which addresses 1624 takes";
    "load-default-value" load_default_value: LoadDefaultValue "4.1.3" "which value of 970 loads the factory settings";
    "pkw-latency" pkw_latency: Count[1 2 20] "3.4.1" "after how many exchanges an answer of the parameter channel comes";
    "pzd-latency" pzd_latency: Count[1 1 20] "3.3" "after how many exchanges the process data show a reaction";
    "task-new-when" task_new_when: TaskNewWhen "3.4.1" "which octets make a task new";
    "negative-pwe1" negative_pwe1: NegativePwe1 "3.4.3" "PWE1 of a word below 0";
    "pwe1-of-word-task" pwe1_of_word_task: Pwe1OfWordTask "3.4.3" "PWE1 of a task that carries a word";
    "ind-low-byte" ind_low_byte: IndLowByte "3.4.2" "a low octet of IND other than 0";
    "subindex-bits" subindex_bits: SubindexBits "3.4.2" "which bits of IND are the sub-index";
    "plain-task-subindex" plain_task_subindex: PlainTaskSubindex "3.4.2" "IND of tasks 1, 2 and 3";
    "position-count" position_count: Count[1 64 64] "5.6" "how many elements 1716 and 1717 have";
    "width-error" width_error: WidthError "3.4.1" "a word task on a double word, or the reverse";
    "online-error" online_error: OnlineError "5" "a change of a parameter without flag O while the inverter runs";
    "ppo1-double-words" ppo1_double_words: Ppo1DoubleWords "3.4.1" "double words under PPO1";
    "description-error-order" description_error_order: DescriptionErrorOrder "3.4.1" "task 4 or 5 on an unknown number";
    "spm" spm: Spm "3.4.1" "a task with bit 11";
    "967-write" control_write: ControlWrite "4.1.3" "a change of the control word through the parameter channel";
    "1732-write" position_limit_write: PositionLimitWrite "5.6" "a change of 1732 or 1733";
    "947-elements" error_elements: ErrorElements "4.1.3" "the elements of 947";
    "rd-inp-under-freeze" rd_inp_under_freeze: RdInpUnderFreeze "EN 2" "what RD_Inp reads under Freeze";
    "diag-flag-cleared-by" diag_flag_cleared_by: DiagFlagClearedBy "EN 2" "whose Slave_Diag takes the report of a diagnosis back";
    "bit4-ramp" bit4_ramp: Bit4Ramp "3.2.1" "how STW bit 4 = 0 takes the frequency to 0";
    "off1-beats-disable" off1_beats_disable: Off1BeatsDisable "3.3" "OFF1 and disable operation in one control word";
    "off1-zsw-while-ramping" off1_zsw_while_ramping: Off1ZswWhileRamping "3.3" "bits 2 to 0 of ZSW while OFF1 ramps down";
    "zsw1-in-qs-fr" zsw1_in_qs_fr: Zsw1InQsFr "3.2.2" "ZSW bit 1 during a quick stop and a fault reaction";
    "timeout-with-1614" timeout_with_1614: TimeoutWith1614 "2.5.1" "the bus time-out with 1614 = 1";
    "both-directions" both_directions: BothDirections "3.2.1" "STW bits 11 and 12 both 1";
    "over-100" over_100: Over100 "3.2.3" "a setpoint above 100 %";
    "position-words" position_words: PositionWords "3.2.3" "which words carry a position of 32 bits";
    "zsw8" zsw8: Zsw8 "3.2.2" "when ZSW bit 8 compares actual value and setpoint";
    "zsw9" zsw9: Zsw9 "3.2.2" "when ZSW bit 9 is 1";
    "zsw10" zsw10: Zsw10 "3.2.2" "what ZSW bit 10 shows";
    "zsw11-at-rest" zsw11_at_rest: Zsw11AtRest "3.2.2" "ZSW bit 11 of a drive at rest";
    "timeout-exactly" timeout_exactly: TimeoutExactly "2.5.1" "a valid PZD at the very instant at which 1625 expires";
    "initial-zsw-4-5" initial_zsw_4_5: InitialZsw45 "3.2.2" "ZSW bits 4 and 5 before the first valid control word";
};
