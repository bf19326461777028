#include "stress/functions.h"

#include "stress/function_table.h"

namespace hsi4d {

std::vector<FunctionErrors> function_errors(Index points) {
  std::vector<FunctionErrors> table;
  stress::add_exponentials(table, points);
  stress::add_rotations(table, points);
  stress::add_harmonics(table, points);
  return table;
}

}  // namespace hsi4d
