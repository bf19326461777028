# cmake -DROOT=source tree -DSCRATCH=folder -P gradient_audit_test.cmake
# Fails when an operator or a loss term is missing from docs/numerics/gradients.md (tools/gradient_audit writes its rows);
# before that, proves on made-up trees that what is missing is found, and nothing else is.
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/gradient_audit.cmake)

# expect(TITLE rows ERRORS…): a tree with the operators exp and mlp and the loss center, and these rows.
function(expect title rows)
  file(REMOVE_RECURSE ${SCRATCH})
  file(WRITE ${SCRATCH}/autodiff/a.cpp "  static constexpr const char* kName = \"exp\";\n")
  file(WRITE ${SCRATCH}/splat/b.h "\n  static constexpr const char* kName = \"mlp\";\n  kName = F::kName;\n")
  file(WRITE ${SCRATCH}/stress/c.h "  static constexpr const char* kName = \"not_of_the_library\";\n")
  file(WRITE ${SCRATCH}/optim/losses/list.h "#define HSI4D_LOSSES \\\n  HSI4D_LOSS(center) \\\n#define HSI4D_LOSS(name) x\n")
  file(WRITE ${SCRATCH}/docs/numerics/gradients.md "Text of `none`.\n\n| operator | inputs |\n|---|---|\n${rows}")
  find_audit_errors(found ${SCRATCH})
  if(NOT "${found}" STREQUAL "${ARGN}")
    message(FATAL_ERROR "The check of the audit itself is wrong (${title}).\nExpected: ${ARGN}\nFound: ${found}")
  endif()
endfunction()

expect("all there" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `mlp` | rows | 1e-7 | 3e-9 | 0 |\n\n| `center` | y | 1e-7 | 3e-9 | 0 |\n")
expect("an operator is missing" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `center` | y | 1e-7 | 3e-9 | 0 |\n" "mlp has no row")
expect("a loss term is missing" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `mlp` | rows | 1e-7 | 3e-9 | 0 |\n" "center has no row")
expect("no figures" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `mlp` | | | | |\n| `center` | y | 1e-7 | 3e-9 | 0 |\n" "mlp lacks a figure")
expect("no complex step, which a loss term may lack" "| `exp` | x | 1e-7 | 3e-9 | |\n| `mlp` | y | 1e-7 | 3e-9 | 0 |\n| `center` | y | 1e-7 | 3e-9 | | |\n"
       "exp lacks a figure")
expect("no differences" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `mlp` | y | 1e-7 | 3e-9 | 0 |\n| `center` | y | 1e-7 | | | |\n"
       "center lacks a figure")
expect("one too many" "| `exp` | x | 1e-7 | 3e-9 | 0 |\n| `mlp` | y | 0 | 0 | 0 |\n| `center` | y | 1e-7 | 3e-9 | 0 |\n| `old` | z | 0 | 0 | 0 |\n" "there is no old")
file(REMOVE_RECURSE ${SCRATCH})

find_audit_errors(errors ${ROOT})
if(errors)
  list(JOIN errors "\n  " errors)
  message(FATAL_ERROR "docs/numerics/gradients.md (run tools/gradient_audit):\n  ${errors}")
endif()
