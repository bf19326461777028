// A generated dataset that a command makes for itself, or finds from an earlier time.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"

namespace hsi4d::cli {

/// Makes the dataset of config.synthetic in `folder`, which is made too. Ends in good order on Ctrl-C.
/// @param threads  as the command line has them; none or 0: what the config says
void make_dataset(const RunConfig& config, const std::vector<LossTerm>& losses, const std::filesystem::path& folder,
                  std::optional<int> threads, bool quiet);

/// Throws UserError unless the dataset in `folder` is the one that the config asks for.
void check_dataset(const RunConfig& config, const std::filesystem::path& folder);

/// Names the files of a dataset in `data` and keeps the other settings.
void name_inputs(const std::filesystem::path& folder, DataSettings& data);

}  // namespace hsi4d::cli
