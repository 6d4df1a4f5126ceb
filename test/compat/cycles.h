/* Cycles of group 0, one each millisecond. Include it behind the header of the interface. */
#ifndef CYCLES_H
#define CYCLES_H

/* Returns the working counter of the last cycle. */
static int cycles(int count) {
    int wkc = 0;
    while (count-- > 0) {
        ec_send_processdata();
        wkc = ec_receive_processdata(EC_TIMEOUTRET);
        osal_usleep(1000);
    }
    return wkc;
}

#endif
