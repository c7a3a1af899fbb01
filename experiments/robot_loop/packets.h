/* packets.h: what robot and controller say to each other over UDP, both little-endian. packets.py
 * has the same for Python. Fields are aligned, so that there is nothing between them. */
#ifndef PACKETS_H
#define PACKETS_H

#include "arm.h"
#include <stdint.h>

#define READING 0x3152444aU /* "JDR1" */
#define COMMAND 0x3143444aU /* "JDC1" */

/* flags of a reading */
#define BRAKED 1U /* the robot's brakes are closed: it takes no commands any more */
/* flags of a command */
#define HELLO 1U /* I am here: send the first reading. No torque. */
#define STOP 2U  /* close the brakes */

typedef struct {
    uint32_t kind;
    uint32_t flags;
    int64_t sequence;     /* of this reading: 0, 1, ... */
    int64_t in_force;     /* sequence of the reading that the present command answers; -1: none */
    double time;          /* of the robot's clock [s] */
    double q[ARM_JOINTS]; /* of the encoders [rad] */
} reading_packet;

typedef struct {
    uint32_t kind;
    uint32_t flags;
    int64_t answers; /* sequence of the reading that this is the answer to */
    double tau[ARM_JOINTS]; /* [Nm] */
} command_packet;

#endif
