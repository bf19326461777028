// What happens in the video of a run, in words.
#pragma once

#include <filesystem>
#include <string>

namespace hsi4d {

/// `sources.prompt` of a run's config, by which its video was made, or else `instance.prompt`, what a benchmark asks
/// for; empty where the folder is no run or says neither. Throws DataError naming a config that is damaged.
std::string run_prompt(const std::filesystem::path& run);

}  // namespace hsi4d
