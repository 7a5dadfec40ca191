//! The codec against the examples of the manual, the parameter list, units and properties.

use super::parameter::{Flag, Limit, NoParameter};
use super::pkw::Index;
use super::properties::{Choices, NordacProperty, PROPERTIES, SubindexBits};
use super::units::BadQuantity;
use super::words::{STW, State, ZSW, set_bits, set_of};
use super::*;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::string::{String, ToString};
use std::vec::Vec;

fn pkw(text: &str) -> Pkw {
    let words: Vec<u16> = text
        .split(' ')
        .map(|word| u16::from_str_radix(word, 16).unwrap())
        .collect();
    let [pke, ind, high, low] = words[..] else {
        panic!("{text}");
    };
    let pkw = Pkw {
        pke,
        ind,
        pwe: u32::from(high) << 16 | u32::from(low),
    };
    assert_eq!(Pkw::decode(pkw.encode()), pkw);
    assert_eq!(pkw.to_string(), text);
    pkw
}

/// NORDAC 3.4: the tasks and answers of the examples.
#[test]
fn tasks_and_answers() {
    for (task, meaning, selection, answer, value) in [
        (
            "14B2 0000 0000 0000",
            Task::Request,
            "1202",
            "14B2 0000 0000 0064",
            Answer::Word(100),
        ),
        (
            "24B5 0200 0000 01F4",
            Task::ChangeWord,
            "1205.3",
            "14B5 0200 0000 01F4",
            Answer::Word(500),
        ),
        (
            "670E 0900 0000 0000",
            Task::RequestArray,
            "1806.9",
            "470E 0900 0000 0000",
            Answer::ArrayWord(0),
        ),
        (
            "9709 0000 0000 0000",
            Task::Elements,
            "1801",
            "6709 0000 0000 0007",
            Answer::Elements(7),
        ),
        (
            "66B4 1500 0000 0000",
            Task::RequestArray,
            "1716.5.2",
            "56B4 1500 0000 0000",
            Answer::ArrayDouble(0),
        ),
        (
            "44B2 0000 0000 0000",
            Task::RequestDescription,
            "1202",
            "74B2 0000 0000 0009",
            Answer::Error(PkwError::NoDescription),
        ),
        (
            "A4B2 0000 0000 0000",
            Task::Invalid(10),
            "1202",
            "74B2 0000 0000 00C9",
            Answer::Error(PkwError::Task),
        ),
    ] {
        let task = pkw(task);
        assert_eq!(task.task(), meaning);
        let selected = ParameterRef::parse(selection).unwrap();
        assert_eq!(
            (selected.parameter.number, selected.ind()),
            (task.number(), task.ind)
        );
        assert_eq!(
            Index::of(selected.parameter, task.ind, SubindexBits::From8),
            selected.index
        );
        assert_eq!(selected.to_string(), selection);
        assert_eq!(value.to(task), pkw(answer));
        assert_eq!(pkw(answer).answer(), Some(value));
    }
    let unknown = pkw("1001 0000 0000 0000");
    assert_eq!(Parameter::of(unknown.number()), None);
    assert_eq!(
        Answer::Error(PkwError::Number).to(unknown),
        pkw("7001 0000 0000 0000")
    );
    assert_eq!(Answer::None.to(pkw("04B2 0100 0000 0001")), Pkw::default());
    // SPM is answered 0.
    assert_eq!(
        Answer::Word(100).to(pkw("1CB2 0000 0000 0000")),
        pkw("14B2 0000 0000 0064")
    );
    // NORDAC 3.4.2: element 21, set 4.
    let position = ParameterRef::parse("1716.21.4").unwrap();
    assert_eq!(position.ind(), 0x5700);
    for ak in 0..16 {
        assert_eq!(Task::of(ak).ak(), ak);
        let answer = Pkw::of(ak, 1, 0, 0).answer();
        assert_eq!(answer.map(Answer::ak), (ak < 8 && ak != 3).then_some(ak));
    }
    let fault = Parameter::of(1806).unwrap();
    assert_eq!(Index::of(fault, 0x0480, SubindexBits::From7).element, 9);
    for code in 0..300 {
        assert_eq!(PkwError::of(code).code(), code);
    }
}

/// NORDAC 3.1, GSD: the four layouts.
#[test]
fn layouts() {
    let lengths: Vec<_> = PpoType::ALL
        .iter()
        .map(|ppo| (ppo.octets(), ppo.words_begin()))
        .collect();
    assert_eq!(lengths, [(12, 8), (20, 8), (4, 0), (12, 0)]);
    for ppo in PpoType::ALL {
        assert_eq!(PpoType::from_cfg(ppo.cfg()), Some(ppo));
        assert_eq!(PpoType::from_raw(ppo.raw()), Some(ppo));
        let words: usize = ppo
            .cfg()
            .iter()
            .map(|octet| {
                crate::profibus::dp::CfgByte::decode(*octet)
                    .unwrap()
                    .octets()
            })
            .sum();
        assert_eq!(words, ppo.octets());
        let image = Image {
            pkw: pkw("14B2 0000 0000 0000"),
            words: [0x047F, 0x2000, 3, 4, 5, 6],
        };
        let data = image.encode(ppo);
        let read = Image::decode(ppo, &data).unwrap();
        assert_eq!((read.first(), read.main()), (0x047F, 0x2000));
        let [third, fourth] = if ppo.words() == 6 { [3, 4] } else { [0, 0] };
        assert_eq!((read.third(), read.fourth()), (third, fourth));
        assert_eq!(read.pkw == image.pkw, ppo.has_pkw());
        assert_eq!(Image::decode(ppo, &data[1..]), None);
    }
    let image = Image {
        words: [0x047F, 0x2000, 0, 0, 0, 0],
        ..Image::default()
    };
    assert_eq!(&*image.encode(PpoType::Three), [0x04, 0x7F, 0x20, 0x00]);
}

/// NORDAC 3.2.2, 3.3: each state, and the words of the sequences.
#[test]
fn words_and_states() {
    for (word, state) in [
        (0x0B70, State::StartDisable),
        (0x0B31, State::ReadyToStart),
        (0x0B33, State::ReadyForOperation),
        (0x0F37, State::OperationEnabled),
        (0x0F17, State::QuickStop),
        (0x0F3F, State::FaultReaction),
        (0x0B38, State::Fault),
        (0x0B30, State::NotReady),
    ] {
        assert_eq!(State::of_zsw(word), Some(state));
        assert_eq!(state.output_on(), word & words::zsw::ENABLED != 0);
    }
    assert_eq!(State::of_zsw(0x0042), None);
    for table in [&STW, &ZSW] {
        assert!(
            table
                .iter()
                .enumerate()
                .all(|(number, bit)| usize::from(bit.number) == number)
        );
    }
    let names: Vec<_> = set_bits(&STW, words::stw::START)
        .map(|bit| bit.name)
        .collect();
    assert_eq!(
        names,
        [
            "ON", "OFF2", "OFF3", "enable", "ramp", "hold", "setpoint", "valid"
        ]
    );
    assert_eq!([0x0000, 0x4000, 0x8000, 0xC000].map(set_of), [0, 1, 2, 3]);
}

/// NORDAC 5: what can be said of the list without typing it again.
#[test]
fn the_list_of_parameters() {
    assert!(PARAMETERS.is_sorted_by_key(|parameter| parameter.number));
    let names: BTreeSet<_> = PARAMETERS.iter().map(|p| p.name.to_lowercase()).collect();
    assert_eq!(names.len(), PARAMETERS.len());
    let count = |section: &str| PARAMETERS.iter().filter(|p| p.section == section).count();
    let sections = ["5.1", "5.2", "5.3", "5.4", "5.5", "5.6", "5.7", "4.1.3"].map(count);
    assert_eq!(sections, [6, 10, 21, 42, 38, 33, 14, 8]);
    for parameter in &PARAMETERS {
        let letters: String = Flag::ALL
            .into_iter()
            .filter(|flag| parameter.has(*flag))
            .map(Flag::letter)
            .collect();
        let sorted: String = "POLAR"
            .chars()
            .filter(|c| parameter.flags.contains(*c))
            .collect();
        assert_eq!(
            (letters, parameter.flags.len()),
            (sorted.clone(), sorted.len())
        );
        let defaults = |number| Parameter::of(number).map_or(0, |p| i64::from(p.default));
        let (least, most) = parameter.limits(defaults);
        let default = i64::from(parameter.default);
        // 918 shows the address: it has no factory setting of its own.
        let fits = (least..=most).contains(&default) || parameter.number == 918;
        assert!(fits, "{}", parameter.number);
        for number in [least, most, default] {
            let raw = parameter
                .raw_of(number)
                .unwrap_or_else(|| panic!("{}", parameter.number));
            assert_eq!(parameter.number_of(raw), number);
        }
        assert_eq!(Parameter::named(parameter.name), Ok(parameter));
        assert!((200..=Pkw::LAST_NUMBER).contains(&parameter.number));
    }
    // Rows of which something can go wrong: symbolic limits, long ones, arrays.
    let fixed = Parameter::of(1605).unwrap();
    assert_eq!((fixed.least, fixed.most), (Limit::MinusFmax, Limit::Fmax));
    assert_eq!(fixed.limits(|_| 700), (-700, 700));
    assert_eq!(Parameter::of(1402).unwrap().limits(|_| 77), (77, 82));
    let arrays: Vec<_> = PARAMETERS
        .iter()
        .filter(|p| p.is_array())
        .map(|p| p.number)
        .collect();
    assert_eq!(
        arrays,
        [
            947, 1700, 1716, 1717, 1731, 1801, 1802, 1803, 1804, 1805, 1806, 1807, 1812, 1813, 1825
        ]
    );
    let double: Vec<_> = PARAMETERS
        .iter()
        .filter(|p| p.has(Flag::Long))
        .map(|p| p.number)
        .collect();
    assert_eq!(
        double,
        [
            1700, 1709, 1716, 1717, 1722, 1723, 1726, 1727, 1732, 1733, 1734
        ]
    );
    assert!(Parameter::of(1734).unwrap().needs_posicon());
    assert_eq!(Parameter::of(1519), None);
}

/// The ways to name a parameter, and what is wrong with others.
#[test]
fn selections() {
    for (text, number, element, set) in [
        ("1205", 1205, 0, 0),
        ("maximum frequ.", 1205, 0, 0),
        ("Maximum frequ..4", 1205, 0, 3),
        ("1205.1", 1205, 0, 0),
        ("1801.6", 1801, 6, 0),
        ("1716.63", 1716, 63, 0),
        ("Position.0.4", 1716, 0, 3),
    ] {
        let selection = ParameterRef::parse(text).unwrap();
        let found = (
            selection.parameter.number,
            selection.index.element,
            selection.index.set,
        );
        assert_eq!(found, (number, element, set), "{text}");
    }
    for (text, wrong) in [
        ("1519", NoParameter::Number),
        ("99999999", NoParameter::Number),
        ("speed", NoParameter::Name),
        ("", NoParameter::Name),
        ("speed.3", NoParameter::Name),
        ("1205.x", NoParameter::Name),
        (
            "1205.0",
            NoParameter::Index {
                number: 1205,
                least: 1,
                most: 4,
            },
        ),
        (
            "1205.5",
            NoParameter::Index {
                number: 1205,
                least: 1,
                most: 4,
            },
        ),
        (
            "1801.7",
            NoParameter::Index {
                number: 1801,
                least: 0,
                most: 6,
            },
        ),
        (
            "1716.64",
            NoParameter::Index {
                number: 1716,
                least: 0,
                most: 63,
            },
        ),
        (
            "1716.1.0",
            NoParameter::Index {
                number: 1716,
                least: 1,
                most: 4,
            },
        ),
        ("1624.1", NoParameter::NoIndex { number: 1624 }),
        ("1205.1.1", NoParameter::NoIndex { number: 1205 }),
    ] {
        assert_eq!(ParameterRef::parse(text), Err(wrong), "{text}");
    }
    let error = ParameterRef::parse("1205.5").unwrap_err().to_string();
    assert_eq!(error, "parameter 1205 has sets 1 to 4");
}

/// Values with units, exactly.
#[test]
fn quantities() {
    let of = |number: u16, element, text: &str| Parameter::of(number).unwrap().parse(element, text);
    for (number, text, raw) in [
        (1202, "5 s", 100),
        (1202, "5.00s", 100),
        (1202, "100", 100),
        (1202, "0.05s", 1),
        (1205, "50.0Hz", 500),
        (1205, "50 hz", 500),
        (1415, "-0.5Hz", -5),
        (1306, "0.80", 80),
        (1306, "80", 80),
        (1302, "1425 rpm", 1425),
        (1302, "1425min-1", 1425),
        (1511, "10 %/ms", 1000),
        (1600, "3", 3),
        (1705, "4rev", 2),
        (1716, "-1.5rev", -1500),
    ] {
        assert_eq!(of(number, 0, text), Ok(raw), "{text}");
    }
    for (number, text) in [
        (1202, "5.00 s"),
        (1415, "-0.5 Hz"),
        (1306, "0.80"),
        (1600, "3"),
        (1705, "4 rev"),
    ] {
        let parameter = Parameter::of(number).unwrap();
        assert_eq!(
            parameter
                .show(0, parameter.parse(0, text).unwrap())
                .to_string(),
            text
        );
    }
    let unit = |number| Parameter::of(number).unwrap().unit;
    for (number, text, wrong) in [
        (1202, "", BadQuantity::Number),
        (1202, "s", BadQuantity::Number),
        (1202, "5.s", BadQuantity::Number),
        (1202, "--5", BadQuantity::Number),
        (1202, "1.2.3s", BadQuantity::Number),
        (1202, "5 Hz", BadQuantity::Unit(unit(1202))),
        (1202, "5.0", BadQuantity::Unit(unit(1202))),
        (1202, "5.01 s", BadQuantity::Step(unit(1202))),
        (1202, "0.00000001 s", BadQuantity::Step(unit(1202))),
        (1705, "3rev", BadQuantity::Step(unit(1705))),
        (1202, "99999999999999999999", BadQuantity::Size),
        (1600, "3 s", BadQuantity::Unit(unit(1600))),
    ] {
        assert_eq!(of(number, 0, text), Err(wrong), "{text}");
    }
    assert_eq!(of(1801, 2, "50.0Hz"), Ok(500));
    assert_eq!(
        of(1202, 0, "5.01 s").unwrap_err().to_string(),
        "the drive counts in steps of 0.05 s: give a multiple of it"
    );
    assert_eq!(
        of(1202, 0, "5 Hz").unwrap_err().to_string(),
        "this parameter is counted in s: give a value such as 0.05 s, or the raw number without unit and point"
    );
}

/// Each property takes each of its values and no other, and the first is its default.
#[test]
fn properties_take_their_values() {
    assert_eq!(PROPERTIES.len(), 48);
    for property in PROPERTIES {
        assert_eq!(
            NordacProperty::of(property.name).map(|p| p.name),
            Some(property.name)
        );
        let mut properties = Properties::default();
        assert!(
            !property.set(&mut properties, "no such value"),
            "{}",
            property.name
        );
        let mut others = BTreeSet::new();
        match property.accepts {
            Choices::Words(words) => {
                for word in words {
                    let mut now = Properties::default();
                    assert!(property.set(&mut now, word), "{}", property.name);
                    assert_eq!(now == properties, *word == words[0], "{}", property.name);
                    others.insert(*word);
                }
                assert!(others.len() == words.len() && words.len() > 1);
            }
            Choices::Count {
                least,
                default,
                most,
            } => {
                for number in 0..=u8::MAX {
                    let mut now = Properties::default();
                    let taken = property.set(&mut now, &number.to_string());
                    assert_eq!(taken, (least..=most).contains(&number));
                    assert_eq!(now == properties, !taken || number == default);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// What is shown is read again.
    #[test]
    fn shown_values_are_read(place in 0..PARAMETERS.len(), raw in any::<u32>()) {
        let parameter = &PARAMETERS[place];
        let number = parameter.number_of(raw);
        let text = parameter.show(0, number).to_string();
        prop_assert_eq!(parameter.parse(0, &text), Ok(number));
    }

    /// No text makes a reader panic.
    #[test]
    fn any_text(text in "\\PC{0,20}", place in 0..PARAMETERS.len()) {
        let _ = ParameterRef::parse(&text);
        let _ = PARAMETERS[place].parse(0, &text);
    }

    /// What selects a parameter is written and read again, on the wire too.
    #[test]
    fn selections_round_trip(place in 0..PARAMETERS.len(), element in 0u16..64, set in 0u8..4) {
        let parameter = &PARAMETERS[place];
        let index = Index { element: element % u16::from(parameter.count), set: set % parameter.sets() };
        let selection = ParameterRef { parameter, index };
        prop_assert_eq!(ParameterRef::parse(&selection.to_string()), Ok(selection));
        prop_assert_eq!(Index::of(parameter, selection.ind(), SubindexBits::From8), index);
    }
}
