// What a terminal is shown: progress on stderr, a bar that is redrawn there and plain lines elsewhere; tables no wider
// than it.
#pragma once

#include <optional>

#include "core/observer.h"

namespace hsi4d::cli {

/// True when stderr is a terminal that understands being rewritten (TERM is set and not "dumb").
bool stderr_is_terminal();

/// How many characters a line has on the terminal that stdout is; nothing where it is a file or another program.
std::optional<int> stdout_columns();

/// Shows progress on stderr (not when `quiet`) and asks to stop after a signal that an InterruptWatch noted. A terminal
/// gets a bar that is redrawn ten times a second; anything else a line at the first step, every ten seconds, and at the
/// end.
Observer observer_on_terminal(bool quiet);

}  // namespace hsi4d::cli
