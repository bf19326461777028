// Shares and intervals of a study, against numbers known from elsewhere and properties that define them.
#include "pipelines/study_results.h"

#include <cmath>

#include <catch2/catch.hpp>

using namespace hsi4d;

TEST_CASE("the interval of a share is Wilson's") {
  // Newcombe 1998, "Two-sided confidence intervals for the single proportion", Stat. Med. 17, table I, method 3.
  const auto check = [](Index prefer_a, Index answers, double low, double high) {
    const ShareInterval interval = wilson_interval({answers, prefer_a});
    CHECK(interval.low == Approx(low).margin(5e-5));
    CHECK(interval.high == Approx(high).margin(5e-5));
  };
  check(81, 263, 0.2553, 0.3662);
  check(15, 148, 0.0624, 0.1605);
  check(0, 20, 0, 0.1611);
  check(1, 29, 0.0061, 0.1718);
  // Its ends are the shares from which what was seen is 1.96 standard errors away.
  for (const Index n : {1, 3, 10, 250}) {
    for (Index k = 0; k <= n; ++k) {
      const ShareInterval interval = wilson_interval({n, k});
      const double p = static_cast<double>(k) / static_cast<double>(n);
      for (const double end : {interval.low, interval.high}) {
        if (end > 1e-12 && end < 1 - 1e-12)
          CHECK(std::fabs(p - end) ==
                Approx(1.959964 * std::sqrt(end * (1 - end) / static_cast<double>(n))).margin(1e-6));
      }
      const ShareInterval other = wilson_interval({n, n - k});
      CHECK(interval.low == Approx(1 - other.high).margin(1e-12));
    }
  }
}

TEST_CASE("the bootstrap draws persons with all their answers") {
  // One answer each: the binomial's spread.
  std::vector<StudyCount> single(400, {1, 0});
  for (std::size_t i = 0; i < 240; ++i) single[i].prefer_a = 1;
  const ShareInterval alone = person_bootstrap(single);
  const double half = 1.959964 * std::sqrt(0.6 * 0.4 / 400);
  CHECK(alone.low == Approx(0.6 - half).margin(0.006));
  CHECK(alone.high == Approx(0.6 + half).margin(0.006));
  // Ten answers each, all alike: no more is known than from one answer each, whatever Wilson's interval says.
  std::vector<StudyCount> alike(40, {10, 0});
  for (std::size_t i = 0; i < 24; ++i) alike[i].prefer_a = 10;
  const ShareInterval groups = person_bootstrap(alike), wilson = wilson_interval({400, 240});
  const double wide = 1.959964 * std::sqrt(0.6 * 0.4 / 40);
  CHECK(groups.low == Approx(0.6 - wide).margin(0.02));
  CHECK(groups.high == Approx(0.6 + wide).margin(0.02));
  CHECK(groups.high - groups.low > 2.5 * (wilson.high - wilson.low));
  // Persons that do not differ leave nothing open, and those with more answers count for more.
  const ShareInterval same = person_bootstrap(std::vector<StudyCount>(5, {10, 7}));
  CHECK(same.low == 0.7);
  CHECK(same.high == 0.7);
  CHECK(person_bootstrap({{10, 10}, {1, 0}}).high == 1);
  CHECK(person_bootstrap(alike).low == groups.low);
}

TEST_CASE("answers are counted by question, pair and side") {
  StudyAnswers answers;
  answers.persons = {{"x", "x.json", "", {{0, 0, true, true, 3}, {0, 1, false, true, 3}, {1, 0, true, false, 4.5}}},
                     {"y", "y.json", "", {{0, 0, false, true, 2}}}};
  const std::vector<StudyShare> shares = study_shares(answers);
  REQUIRE(shares.size() == 2);
  CHECK(shares[0].persons == 2);
  CHECK(shares[0].all.answers == 3);
  CHECK(shares[0].all.prefer_a == 2);
  CHECK(shares[0].prefer_left == 1);
  REQUIRE(shares[0].by_pair.size() == 2);
  CHECK(shares[0].by_pair[0].second.answers == 2);
  CHECK(shares[0].by_pair[0].second.prefer_a == 1);
  CHECK(shares[0].by_pair[1].second.prefer_a == 1);
  CHECK(shares[0].bootstrap.has_value());
  CHECK(shares[1].all.prefer_a == 0);
  CHECK_FALSE(shares[1].bootstrap.has_value());
  StudyKey key;
  key.pairs = {{"p", "sits, then \"stands\"", "sits", "a", "b"}, {"q", "walk", "", "c", "d"}};
  CHECK(study_answers_csv(key, answers) ==
        "person,pair,question,prefers,left,seconds\n"
        "x,\"sits, then \"\"stands\"\"\",quality,A,A,3\n"
        "x,\"sits, then \"\"stands\"\"\",text,B,A,3\n"
        "x,walk,quality,A,B,4.5\n"
        "y,\"sits, then \"\"stands\"\"\",quality,B,A,2\n");
}
