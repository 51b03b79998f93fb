/* The only header bindgen reads for Embree. */
#include <embree4/rtcore.h>
