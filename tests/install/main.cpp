// Prints the version of the hsi4d that it was linked to.
#include <hsi4d/core/version.h>
#include <iostream>

int main() {
  std::cout << "hsi4d " << hsi4d::version() << '\n';
  return 0;
}
