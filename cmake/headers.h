// Precompiled for the library (hsi4d_build.cmake): what nearly every source file includes. A file includes what it uses
// all the same; the preset `dev` compiles without this one.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
