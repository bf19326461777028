// A study's key and two persons' answers: one file of the three is tried, the others are good.
#include <cmath>

#include "core/json_text.h"
#include "pipelines/study/results.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::study_fuzz {

namespace {

constexpr std::size_t kKey = 0, kFiles = 3;

StudyKey small_key() {
  StudyKey key{"",     "runs/best", "runs/other",
               "00ff", 2,           {{"p1", "walk", "a person walks", "v1", "v2"}, {"p2", "sit", "", "v3", "v4"}}};
  key.study = study_id(key);
  return key;
}

/// @param person  also how each pair is answered: Anna prefers A, others B
std::string answers_of(const std::string& person) {
  const bool is_for_a = person == "anna";
  return R"({"format": "hsi4d study answers", "version": 1, "study": ")" + small_key().study + R"(", "person": ")" +
         person + R"(", "begun": "2026-01-02T03:04:05Z", "finished": "2026-01-02T03:14:05Z",
 "answers": [{"pair": "p1", "left": "v1", "right": "v2", "chosen": {"quality": ")" +
         (is_for_a ? "v1" : "v2") + R"(", "text": "v2"}, "seconds": 12.5, "plays": 1},
  {"pair": "p2", "left": "v4", "right": "v3", "chosen": {"quality": ")" +
         (is_for_a ? "v3" : "v4") + R"("}, "seconds": 7, "plays": 2}]})";
}

Scratch& scratch() {
  static Scratch made({{"key.json", bytes_of(study_key_json(small_key()))},
                       {"answers/anna.json", bytes_of(answers_of("anna"))},
                       {"answers/bert.json", bytes_of(answers_of("bert"))}});
  return made;
}

/// What a key says, whatever is missing or wrong.
StudyKey said(const ConfigValue& tree) {
  StudyKey key{"", string_member(tree, "a"), string_member(tree, "b"), string_member(tree, "salt"), 0, {}};
  if (const ConfigValue* const count = find_member(tree, "pairs_per_person"))
    key.pairs_per_person = whole_number_of(*count, "");
  if (const ConfigValue* const pairs = find_member(tree, "pairs")) {
    for (const ConfigValue& pair : pairs->items)
      key.pairs.push_back({string_member(pair, "id"), string_member(pair, "name"), string_member(pair, "text"),
                           string_member(pair, "a"), string_member(pair, "b")});
  }
  return key;
}

/// A key whose "study" is the hash of what it says, or else the bytes as they are: nearly every mutation would end at a
/// hash of something else.
Bytes with_hash(std::span<const uint8_t> file) {
  Bytes made(file.begin(), file.end());
  is_read([&] {
    ConfigValue tree = parse_json_text(std::string(file.begin(), file.end()), "key.json");
    for (ConfigMember& member : tree.members) {
      if (member.key == "study" && member.value.kind == ConfigValue::Kind::kString)
        member.value.text = study_id(said(tree));
    }
    made = bytes_of(to_json(tree));
  });
  return made;
}

void check_share(const StudyShare& share) {
  HSI4D_CHECK(share.all.answers > 0 && share.all.prefer_a <= share.all.answers, "more choices than answers");
  HSI4D_CHECK(share.wilson.low <= share.all.share() && share.all.share() <= share.wilson.high,
              "a share beside its interval");
  HSI4D_CHECK(share.student.has_value() == (share.persons > 1), "an interval over one person");
}

}  // namespace

std::vector<Bytes> corpus() {
  StudyKey unnamed = small_key();  // becomes a good key by its hash
  unnamed.a = "runs/another";
  std::vector<Bytes> all = scratch().corpus();
  all.push_back(Scratch::with_choice(kKey, bytes_of(study_key_json(unnamed))));
  return all;
}

bool accepts(std::span<const uint8_t> file) {
  const bool is_key = file.empty() || file[0] % kFiles == kKey;
  scratch().try_file(file, [is_key](std::span<const uint8_t> rest) {
    return is_key ? with_hash(rest) : Bytes(rest.begin(), rest.end());
  });
  return is_read([&] {
    const StudyKey key = read_study_key(scratch() / "key.json");
    HSI4D_CHECK_EQ(study_id(key), key.study);
    // Answers to a key that is tried are to another study, unless it is the good one.
    if (is_key && key.study != small_key().study) return;
    const StudyAnswers answers = read_study_answers({scratch() / "answers"}, key);
    const std::vector<StudyShare> shares = study_shares(answers);
    for (const StudyShare& share : shares) check_share(share);
    parse_json_text(study_results_json(key, answers, shares), "results.json");
    HSI4D_CHECK(!study_answers_csv(key, answers).empty(), "a table without a head");
  });
}

const Target target("study", corpus, accepts);

}  // namespace hsi4d::fuzz::study_fuzz
