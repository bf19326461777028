// `hsi4d evaluate`: errors of runs and motions against the truth.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace hsi4d::cli {

struct EvaluateOptions {
  std::vector<std::string> inputs;  ///< folders of runs, motions (.npz), folders of SMPLer-X
  std::string truth;                ///< --truth PATH; empty: what the run's config names
  std::string body_model;           ///< --body-model M.npz
  std::string avatar;               ///< --avatar F.safetensors
  std::optional<double> from_rate;  ///< --from-rate HZ: of motions, instead of what they say
  int person = 0;                   ///< --person N, of a folder of SMPLer-X
  std::string json;                 ///< --json F; empty: none
};

/// A table with a row for each metric of summary.json that can be measured, and a column for each input; for several
/// their mean and standard deviation too. Writes the JSON file.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string evaluate_command(const EvaluateOptions& options);

}  // namespace hsi4d::cli
