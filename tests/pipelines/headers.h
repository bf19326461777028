// Precompiled for the tests of pipelines/, beside tests/headers.h.
#include <nlohmann/json.hpp>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"
