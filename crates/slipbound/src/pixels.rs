//! Every loop over pixels in the house, one kernel a file. Plain functions on borrowed buffers; nothing allocates
//! after the scratch of a kernel has been made.
