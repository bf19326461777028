// Progress on stderr: a bar that is redrawn on a terminal, plain lines elsewhere.
#pragma once

#include "core/progress.h"

namespace hsi4d::cli {

/// True when stderr is a terminal that understands being rewritten (TERM is set and not "dumb").
bool stderr_is_terminal();

/// Shows progress on stderr. A terminal gets a bar that is redrawn, anything else a line now and then.
ProgressSink progress_on_stderr();

/// Seconds between two reports that suit stderr: 0.1 on a terminal, 10 elsewhere.
double progress_interval();

}  // namespace hsi4d::cli
