//! The classes of what can happen to a drive's end of the bus (ND21 9.1-9.9), as the matrix counts them.

use super::named::named;

named! {
    /// What a byte is where it arrives, or silence. A good 00 is always [`Event::Zero`], and a byte with a line error
    /// is that error, whatever its data bits are.
    Event {
        Synco = "9.2", "SYNCO";
        Pause = "9.2", "PAUSE";
        AddressFollows = "9.2", "sync byte, address byte follows";
        SameDrive = "9.2", "sync byte, same drive";
        NextDrive = "9.2", "sync byte, next drive";
        EmptyShort = "9.2", "sync byte, short address without net bytes";
        NoSyncByte = "9.2", "no sync byte";
        OwnAddress = "9.3", "address byte of this drive";
        OtherAddress = "9.3", "address byte of another drive";
        NetByte = "9.3", "net byte";
        ProcessData = "9.4", "process data";
        ReadByte = "10.1", "command byte ReadByte";
        ReadWord = "10.1", "command byte ReadWord";
        ReadLong = "10.1", "command byte ReadLong";
        WriteByte = "10.2", "command byte WriteByte";
        WriteWord = "10.2", "command byte WriteWord";
        And = "10.3", "command byte And";
        Or = "10.3", "command byte Or";
        WriteIo = "10.4", "command byte WriteIO";
        ResetH8 = "10.5", "command byte ResetH8";
        UnknownCommand = "9.7", "unknown command byte";
        Accepted = "9.5", "byte of a command, accepted";
        Refused = "9.7", "byte of a command, refused";
        RightCheck = "9.6", "right checking byte";
        WrongCheck = "9.6", "wrong checking byte";
        SequenceStart = "9.8", "FF, the first byte of the check sequence";
        SequenceNext = "9.8", "next byte of the check sequence";
        OtherByte = "9.7", "another byte in the error mode";
        Zero = "9.7", "zero";
        Parity = "8.3", "parity error";
        Framing = "8.3", "framing error";
        Break = "8.3", "break";
        Overrun = "8.3", "overrun";
        Silence = "9.9", "silence until something is due";
    }
}
