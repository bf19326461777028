#include "pipelines/record/gradient_table.h"

#include <algorithm>

#include "core/json_text.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

constexpr const char* kKey = "gradient_shares";

/// The object of a group, made where it is new.
ConfigValue& group_object(ConfigValue& groups, const std::string& group) {
  for (ConfigMember& member : groups.members) {
    if (member.key == group) return member.value;
  }
  groups.add(group, ConfigValue::make_object());
  return groups.members.back().value;
}

MeanGradientShare& mean_share_of(std::vector<MeanGradientShare>& means, const std::string& group,
                                 const std::string& term) {
  const auto found = std::find_if(means.begin(), means.end(), [&](const MeanGradientShare& mean) {
    return mean.group == group && mean.term == term;
  });
  return found != means.end() ? *found : means.emplace_back(MeanGradientShare{group, term});
}

/// Calls visit(group, term, its object, pointer) for each.
template <class F>
void for_shares(const ConfigValue& groups, const std::string& pointer, F visit) {
  check_kind(groups, Kind::kObject, pointer);
  for (const ConfigMember& group : groups.members) {
    const std::string of_group = child_pointer(pointer, group.key);
    check_kind(group.value, Kind::kObject, of_group);
    for (const ConfigMember& term : group.value.members) {
      const std::string of_term = child_pointer(of_group, term.key);
      check_kind(term.value, Kind::kObject, of_term);
      visit(group.key, term.key, term.value, of_term);
    }
  }
}

double number_member(const ConfigValue& object, const std::string& pointer, const char* key) {
  const ConfigValue* const member = find_member(object, key);
  if (member == nullptr) fail_at(object, pointer, std::string("there is no \"") + key + "\"");
  return number_of(*member, child_pointer(pointer, key));
}

void add_line(const ConfigValue& line, const std::string& stage, std::vector<MeanGradientShare>& sums) {
  check_kind(line, Kind::kObject, "");
  const ConfigValue* const shares = find_member(line, kKey);
  if (shares == nullptr || string_member(line, "stage") != stage) return;
  for_shares(*shares, std::string("/") + kKey,
             [&](const std::string& group, const std::string& term, const ConfigValue& value, const std::string& at) {
               MeanGradientShare& sum = mean_share_of(sums, group, term);
               sum.share += number_member(value, at, "share");
               sum.cosine += number_member(value, at, "cosine");
               ++sum.evaluations;
             });
}

}  // namespace

ConfigValue gradient_shares_json(std::span<const GradientShare> shares) {
  ConfigValue groups = ConfigValue::make_object();
  for (const GradientShare& share : shares) {
    ConfigValue numbers = ConfigValue::make_object();
    numbers.add("norm", ConfigValue::make_number(share.norm));
    numbers.add("share", ConfigValue::make_number(share.share));
    numbers.add("cosine", ConfigValue::make_number(share.cosine));
    group_object(groups, share.group).add(share.term, std::move(numbers));
  }
  return groups;
}

std::vector<MeanGradientShare> mean_gradient_shares(const std::string& metrics, const std::string& stage,
                                                    const std::string& name) {
  std::vector<MeanGradientShare> means;
  int number = 0;
  for (std::size_t begin = 0; begin < metrics.size();) {
    const std::size_t end = std::min(metrics.find('\n', begin), metrics.size());
    const std::string line = metrics.substr(begin, end - begin);
    begin = end + 1;
    ++number;
    if (line.find(kKey) != std::string::npos) add_line(parse_json_text(line, name, number), stage, means);
  }
  for (MeanGradientShare& mean : means) {
    mean.share /= static_cast<double>(mean.evaluations);
    mean.cosine /= static_cast<double>(mean.evaluations);
  }
  return means;
}

ConfigValue mean_shares_json(std::span<const MeanGradientShare> shares) {
  ConfigValue groups = ConfigValue::make_object();
  for (const MeanGradientShare& share : shares) {
    ConfigValue numbers = ConfigValue::make_object();
    numbers.add("share", ConfigValue::make_number(share.share));
    numbers.add("cosine", ConfigValue::make_number(share.cosine));
    numbers.add("evaluations", ConfigValue::make_integer(share.evaluations));
    group_object(groups, share.group).add(share.term, std::move(numbers));
  }
  return groups;
}

std::vector<MeanGradientShare> parse_mean_shares(const ConfigValue& value, const std::string& pointer) {
  std::vector<MeanGradientShare> means;
  for_shares(value, pointer,
             [&](const std::string& group, const std::string& term, const ConfigValue& numbers, const std::string& at) {
               MeanGradientShare mean{group, term, number_member(numbers, at, "share"),
                                      number_member(numbers, at, "cosine"), 0};
               if (const ConfigValue* const count = find_member(numbers, "evaluations"))
                 mean.evaluations = whole_number_of(*count, child_pointer(at, "evaluations"));
               means.push_back(std::move(mean));
             });
  return means;
}

Table shares_table(const std::string& heading, const std::vector<MeanGradientShare>& shares) {
  Table table{.head = {heading}, .align = "lr"};
  std::vector<std::string> groups;
  for (const MeanGradientShare& share : shares) {
    const auto is_it = [&share](const Cell& cell) { return cell.text == share.term; };
    auto term = std::find_if(table.head.begin() + 1, table.head.end(), is_it);
    if (term == table.head.end()) term = table.head.insert(term, Cell(share.term));
    auto group = std::find(groups.begin(), groups.end(), share.group);
    const auto row = static_cast<std::size_t>(group - groups.begin());
    if (group == groups.end()) {
      groups.push_back(share.group);
      table.rows.push_back({share.group});
    }
    std::vector<Cell>& cells = table.rows[row];
    const auto column = static_cast<std::size_t>(term - table.head.begin());
    cells.resize(std::max(cells.size(), column + 1), kNoCell);
    cells[column] = fixed_number(100 * share.share, 1) + " % (" + fixed_number(share.cosine, 2) + ")";
  }
  for (auto& cells : table.rows) cells.resize(table.head.size(), kNoCell);
  return table;
}

std::string gradient_table(const RunSummary& summary) {
  std::string text;
  for (const StageSummary& stage : summary.metrics) {
    if (!stage.gradient_shares.empty()) text += table_text(shares_table("stage " + stage.stage, stage.gradient_shares));
  }
  return text.empty()
             ? text
             : "shares of the gradient, and cosines with the whole (means over the iterations looked at)\n" + text;
}

}  // namespace hsi4d
