#include "core/suggest.h"

#include <catch2/catch.hpp>

namespace suggest_test {

using namespace hsi4d;

TEST_CASE("edit distance counts insertions, deletions, substitutions and swaps") {
  CHECK(edit_distance("", "") == 0);
  CHECK(edit_distance("abc", "") == 3);
  CHECK(edit_distance("blur", "blurr") == 1);
  CHECK(edit_distance("near", "mear") == 1);
  CHECK(edit_distance("form", "from") == 1);
  CHECK(edit_distance("Alpha-Min", "alpha_min") == 0);
  CHECK(edit_distance("kitten", "sitting") == 3);
}

TEST_CASE("the nearest name is suggested only when it is near") {
  const std::vector<std::string> known = {"iterations", "optimize", "losses", "lr"};
  CHECK(nearest_name("iteration", known) == "iterations");
  CHECK(nearest_name("optimise", known) == "optimize");
  CHECK(nearest_name("iter", known) == "iterations");
  CHECK(nearest_name("rl", known) == "lr");
  CHECK(nearest_name("temperature", known).empty());
  CHECK(nearest_name("x", known).empty());
  CHECK(nearest_name("", known).empty());
  CHECK(nearest_name(std::string(100000, 'a'), known).empty());
  CHECK(did_you_mean("loses", known) == "; did you mean \"losses\"?");
  CHECK(did_you_mean("qqqqq", known).empty());
}

}  // namespace suggest_test
