#pragma once

#include <cstdint>

namespace disparity_refinement {

/// condition ? a : b without a branch, which a processor could not predict where the condition depends on the
/// image. Compilers turn the conditional operator into a branch as they like.
inline std::int32_t select(bool condition, std::int32_t a, std::int32_t b) {
  return b ^ ((a ^ b) & -static_cast<std::int32_t>(condition));
}

}  // namespace disparity_refinement
