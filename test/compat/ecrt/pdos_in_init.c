/* A slave that stays in INIT cannot be asked for its PDOs, and the log says so: nobody configures it. Ends with 0 when
 * everything is as expected. */
#include <check.h>

#include <ecrt.h>
#include <errno.h>
#include <stdio.h>

int main(void) {
    ec_master_t* const master = ecrt_request_master(0);
    ec_sync_info_t sync;
    CHECK(master != NULL);
    CHECK(ecrt_master_get_sync_manager(master, 0, 2, &sync) == -EIO);
    ecrt_release_master(master);
    return 0;
}
