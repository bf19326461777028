// Shares of the gradient in the files of a run: metrics.jsonl has them by iteration, summary.json their means, and the
// program shows these as a table.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/config_value.h"
#include "optim/gradient_shares.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

/// {GROUP: {TERM: {"norm", "share", "cosine"}...}...}, in order.
ConfigValue gradient_shares_json(std::span<const GradientShare> shares);

/// Means over the lines of a metrics.jsonl that are of the stage and have shares, groups and terms in the order of
/// their first appearance. @param name  what messages call the text Throws DataError naming file and line for a line
/// that is none of a run's.
std::vector<MeanGradientShare> mean_gradient_shares(const std::string& metrics, const std::string& stage,
                                                    const std::string& name);

/// {GROUP: {TERM: {"share", "cosine", "evaluations"}...}...}, in order.
ConfigValue mean_shares_json(std::span<const MeanGradientShare> shares);

/// Reads it. Throws DataError naming file, line and member.
std::vector<MeanGradientShare> parse_mean_shares(const ConfigValue& value, const std::string& pointer);

/// The means of a stage: a row a group, a column a term with its share in percent and its cosine.
/// @param heading  of the first column
Table shares_table(const std::string& heading, const std::vector<MeanGradientShare>& shares);

/// These of each stage that has any, as plain text. Empty where nothing was measured.
std::string gradient_table(const RunSummary& summary);

}  // namespace hsi4d
