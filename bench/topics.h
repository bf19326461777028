// Which options each topic of `hsi4d bench` has: in its help, and in what is refused.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace hsi4d::cli {

/// What an option means to some topics.
struct BenchMeaning {
  std::vector<std::string> topics;
  std::string text;  ///< begins in lower case
};

/// A topic, and what its help says of it.
struct BenchTopic {
  std::string name, summary;
};

/// All topics, in order.
const std::vector<BenchTopic>& bench_topics();
std::vector<std::string> bench_topic_names();

/// Those that are measured where no topic is named.
std::vector<std::string> kernel_topics();

/// The options of the command, each with what it means to which topics.
class BenchTopicOptions {
 public:
  /// Describes an option, to the topics that have it.
  void add(CLI::Option* option, std::vector<BenchMeaning> meanings);

  /// Throws UserError where an option was given that the topic does not have; tells which have it, and what it has.
  /// @param topic  "": none was named, the kernels are measured
  void refuse_others(const std::string& topic) const;

  /// Makes the command's help that of the topic: its own options alone, in its own words.
  void describe_topic(const std::string& topic, CLI::App& command) const;

 private:
  struct Entry {
    CLI::Option* option;
    std::vector<BenchMeaning> meanings;
  };
  /// What an option means to a topic; null: the topic does not have it.
  static const BenchMeaning* meaning_for(const Entry& entry, const std::string& topic);

  std::vector<Entry> entries_;
};

}  // namespace hsi4d::cli
