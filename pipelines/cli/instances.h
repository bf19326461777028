// The benchmark's instances that `hsi4d list scenes` tells: the configs of configs/anyinteraction.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// Where the configs are: configs/anyinteraction here, or beside the program where it is installed; empty: nowhere.
std::filesystem::path instance_folder();

/// A row an instance, in the order of their names: name, prompt, object, and its data's folder or the stand-in.
/// Configs without a prompt are none. Throws as load_run_config.
std::vector<std::vector<std::string>> instance_rows(const std::filesystem::path& folder,
                                                    const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
