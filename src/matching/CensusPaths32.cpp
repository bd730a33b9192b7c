// Compiled with -mavx2 where the compiler knows it.

#include "CensusPaths.hpp"

#ifdef __AVX2__
#include "ByteVector32.hpp"
#include "CensusPathsLoops.hpp"

namespace disparity_refinement {

const CensusPathsFunctions* censusPaths32() { return &CensusPathsDispatch<ByteVector32>::FUNCTIONS; }

}  // namespace disparity_refinement
#else
namespace disparity_refinement {

const CensusPathsFunctions* censusPaths32() { return nullptr; }

}  // namespace disparity_refinement
#endif
