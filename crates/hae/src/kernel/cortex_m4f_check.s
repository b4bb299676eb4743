@ The check of the map's inputs for Cortex-M4: five at a time, without branches on the values.
@
@ uint32_t hae_m4f_beyond(const float *q, size_t inputs)
@   bit 31 of the result is set if a magnitude, as bits, is above that of 2 pi

        .syntax unified
        .thumb
        .section .text.hae_m4f_beyond, "ax", %progbits
        .global hae_m4f_beyond
        .type   hae_m4f_beyond, %function
        .p2align 2

        .macro  hae_beyond value
        bic     \value, \value, #0x80000000
        sub     \value, r2, \value
        orrs    r3, \value
        .endm

        .thumb_func
hae_m4f_beyond:
        push    {r4-r7, lr}
        movw    r2, #0x0fdb
        movt    r2, #0x40c9
        movs    r3, #0
1:      subs    r1, #5
        blt     2f
        ldmia   r0!, {r4-r7, r12}
        hae_beyond r4
        hae_beyond r5
        hae_beyond r6
        hae_beyond r7
        bic     r12, r12, #0x80000000
        sub     r12, r2, r12
        orr     r3, r3, r12
        b       1b
2:      adds    r1, #5
        beq     4f
3:      ldmia   r0!, {r4}
        hae_beyond r4
        subs    r1, #1
        bne     3b
4:      mov     r0, r3
        pop     {r4-r7, pc}
        .size   hae_m4f_beyond, . - hae_m4f_beyond
