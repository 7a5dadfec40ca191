//! The states of a drive's end of the bus (ND21 9.1-9.9), as the matrix counts them.

use super::named::named;

named! {
    /// What the next byte is to a drive, and what it remembers that decides the answer.
    State {
        SyncNoAddress = "9.2", "sync byte due, no address byte seen";
        SyncOther = "9.2", "sync byte due, another drive was addressed";
        SyncOtherBegun = "9.5", "sync byte due, another drive was addressed, a command is begun";
        SyncOwn = "9.2", "sync byte due, this drive was addressed";
        SyncOwnBegun = "9.5", "sync byte due, this drive was addressed, a command is begun";
        Address = "9.3", "address byte due, parameter bytes follow";
        AddressProcess = "9.3", "address byte due, process data follow";
        Passing = "9.3", "net bytes for another drive due";
        PassingLast = "9.3", "last net byte for another drive due";
        ProcessHigh = "9.4", "high byte of the process data due";
        ProcessLow = "9.4", "low byte of the process data due";
        Command = "9.5", "command byte due";
        AddrL = "10.1", "low byte of an address due";
        AddrH = "10.1", "high byte of an address due";
        AddrInPage = "10.3", "address in page FF due";
        Data = "10.2", "data byte due";
        Code = "10.4", "output code due";
        Fixed = "10.1", "fixed byte due";
        Check = "9.6", "checking byte due";
        CheckReset = "10.5", "checking byte of ResetH8 due";
        ErrorZeros = "9.7", "error mode";
        ErrorSeven = "9.7", "error mode, seven zeros in a row";
        ErrorLong = "9.7", "error mode, 17 zeros sent";
        ErrorLongSeven = "9.7", "error mode, 17 zeros sent, seven zeros in a row";
        Upstream = "9.7", "error mode behind the *";
        UpstreamSixteen = "9.7", "error mode behind the *, 16 zeros sent";
        Increments = "9.7", "error mode, received + 1";
        Sequence1 = "9.8", "error mode behind the *, check sequence up to FF";
        Sequence2 = "9.8", "error mode behind the *, check sequence up to FF 44";
        Sequence3 = "9.8", "error mode behind the *, check sequence up to FF 44 72";
        Sequence4 = "9.8", "error mode behind the *, check sequence up to FF 44 72 4C";
        IncrementsSequence1 = "9.8", "error mode, received + 1, check sequence up to FF";
        IncrementsSequence2 = "9.8", "error mode, received + 1, check sequence up to FF 44";
        IncrementsSequence3 = "9.8", "error mode, received + 1, check sequence up to FF 44 72";
        IncrementsSequence4 = "9.8", "error mode, received + 1, check sequence up to FF 44 72 4C";
        Waiting = "9.9", "time-out";
        WaitingSeven = "9.9", "time-out, seven zeros in a row";
        WaitingIncrements = "9.9", "time-out, received + 1";
        WaitingSequence1 = "9.9", "time-out, check sequence up to FF";
        WaitingSequence2 = "9.9", "time-out, check sequence up to FF 44";
        WaitingSequence3 = "9.9", "time-out, check sequence up to FF 44 72";
        WaitingSequence4 = "9.9", "time-out, check sequence up to FF 44 72 4C";
        Sending = "9.9", "time-out, zeros unasked";
        SendingSeven = "9.9", "time-out, zeros unasked, seven zeros in a row";
        SendingIncrements = "9.9", "time-out, zeros unasked, received + 1";
        SendingSequence1 = "9.9", "time-out, zeros unasked, check sequence up to FF";
        SendingSequence2 = "9.9", "time-out, zeros unasked, check sequence up to FF 44";
        SendingSequence3 = "9.9", "time-out, zeros unasked, check sequence up to FF 44 72";
        SendingSequence4 = "9.9", "time-out, zeros unasked, check sequence up to FF 44 72 4C";
    }
}
